"""The layout of the code, measured: which module imports which, and which rules of the layout are broken.

Nouns: a *module* is a Python file of the package, named by its path below the root (``scenes/folder.py``). A *room* is
a folder of the root (``scenes``). A *unit* of a room is a sub-room (``scenes/geodata``) or a file that lies in the room
itself (``scenes/folder.py``). A *floor* is the level of a room, or of a unit inside its room: imports run from higher
floors to lower ones. Everything is read from the syntax trees of the files. Nothing is imported, and imports under
``TYPE_CHECKING`` or inside functions count like all others.

``python -m tests.house`` prints the picture of the imports and how often each rule is broken.
"""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

#: Rooms from the ground floor up; "" is the root. Rooms on one floor do not import each other.
FLOORS = (("core",), ("scenes",), ("evaluators", "detectors"), ("benchmark",), ("reports",), ("cli",), ("",))

#: Units of a room from the ground floor up; "*" are the files of the room that are not named.
#: Units on one floor do not import each other, but the files of "*" may.
UNITS = {
    "scenes": (("geodata",), ("ground",), ("*",), ("importing", "synthetic")),
    "evaluators": (
        ("tally", "index", "verdict_table"),
        ("overlay",),
        ("base",),
        ("threshold_free",),
        ("*",),
        ("uncertainty",),
    ),
    "detectors": (
        ("steps", "streams"),
        ("base",),
        ("shared",),
        ("*",),
        ("ndsm", "lines", "mpp", "dempster_shafer", "external"),
    ),
    "benchmark": (("identity",), ("store",), ("suite",), ("plan",), ("execution",), ("analysis",), ("*",)),
    "reports": (("*",), ("steps",)),
}

MOST_LINES = 450
MOST_ARGUMENTS = 8

#: The only module that may import numba's compilers.
KERNELS = "core/kernels.py"


@dataclass(frozen=True)
class Import:
    """A name that the module `source` takes from the module `target`; "" stands for the module itself."""

    source: str
    target: str
    name: str


@dataclass(frozen=True)
class Module:
    """A file of the package, by its path below the root."""

    name: str
    path: Path

    @cached_property
    def lines(self) -> int:
        return self.path.read_text(encoding="utf-8").count("\n")

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.path.read_text(encoding="utf-8"))

    @property
    def package(self) -> tuple[str, ...]:
        return tuple(self.name.split("/")[:-1])

    @property
    def room(self) -> str:
        return self.name.split("/")[0] if "/" in self.name else ""

    @property
    def unit(self) -> str:
        """The sub-room, or the stem of a file that lies in the room itself."""
        parts = self.name.removesuffix(".py").split("/")
        return parts[min(1, len(parts) - 1)]

    @property
    def is_package(self) -> bool:
        return self.path.name == "__init__.py"

    @cached_property
    def public(self) -> frozenset[str] | None:
        """The names in ``__all__``; None where there is none."""
        for node in self.tree.body:
            if isinstance(node, ast.Assign) and any(ast.unparse(target) == "__all__" for target in node.targets):
                return frozenset(ast.literal_eval(node.value))
        return None

    @cached_property
    def foreign(self) -> list[tuple[str, str]]:
        """The imports of other packages, as (module, name); the name is "" where the module itself is imported."""
        found = []
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                found += [(alias.name, "") for alias in node.names]
            elif isinstance(node, ast.ImportFrom) and not node.level:
                found += [(node.module or "", alias.name) for alias in node.names]
        return found

    @cached_property
    def functions(self) -> list[tuple[str, int]]:
        """Every function as (qualified name, number of arguments without ``self`` and options of commands)."""
        return list(_functions(self.tree, ""))


def _functions(node: ast.AST, prefix: str) -> Iterator[tuple[str, int]]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            given = [*child.args.posonlyargs, *child.args.args, *child.args.kwonlyargs]
            given += [argument for argument in (child.args.vararg, child.args.kwarg) if argument]
            if isinstance(node, ast.ClassDef) and given and given[0].arg in ("self", "cls"):
                given = given[1:]
            yield prefix + child.name, sum(not _is_option(argument) for argument in given)
        named = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        yield from _functions(child, f"{prefix}{child.name}." if named else prefix)


def _is_option(argument: ast.arg) -> bool:
    """Return whether an argument declares an option of a command (typer), as a field of a dataclass declares one."""
    annotation = "" if argument.annotation is None else ast.unparse(argument.annotation)
    return bool(re.search(r"typer\.(Option|Argument)\(|\b\w+(Option|Argument)\b", annotation))


class House:
    """The modules below a root, and the imports between them."""

    def __init__(self, root: Path = ROOT) -> None:
        rooms = [room for floor in FLOORS for room in floor if room]
        paths = [*root.glob("*.py"), *(path for room in rooms for path in (root / room).rglob("*.py"))]
        names = sorted(path.relative_to(root).as_posix() for path in paths)
        self.root = root
        self.modules = {name: Module(name, root / name) for name in names}

    def module(self, parts: tuple[str, ...]) -> Module | None:
        """Return the module or package of a dotted name below the root."""
        for name in ("/".join(parts) + ".py", "/".join((*parts, "__init__.py"))):
            if name in self.modules:
                return self.modules[name]
        return None

    @cached_property
    def imports(self) -> list[Import]:
        return [found for module in self.modules.values() for found in self._imports_of(module)]

    def _imports_of(self, module: Module) -> Iterator[Import]:
        bound = {}
        for node in ast.walk(module.tree):
            if not isinstance(node, ast.ImportFrom) or not node.level:
                continue
            folder = module.package[: len(module.package) - node.level + 1]
            home = (*folder, *(node.module.split(".") if node.module else ()))
            for alias in node.names:
                target = self.module((*home, alias.name))
                if target:
                    bound[alias.asname or alias.name] = target
                    yield Import(module.name, target.name, "")
                else:
                    target = self.module(home)
                    assert target, f"{module.name}:{node.lineno} imports {'.'.join(home)}, which does not exist"
                    yield Import(module.name, target.name, alias.name)
        for node in ast.walk(module.tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in bound:
                yield Import(module.name, bound[node.value.id].name, node.attr)

    @cached_property
    def arrows(self) -> dict[str, set[str]]:
        """Module to the modules that it imports."""
        arrows: dict[str, set[str]] = {name: set() for name in self.modules}
        for found in self.imports:
            if found.source != found.target:
                arrows[found.source].add(found.target)
        return arrows

    @cached_property
    def circles(self) -> list[list[str]]:
        """The groups of modules that reach each other by imports (strongly connected components)."""
        reach = {name: self._reached(name) for name in self.arrows}
        groups = {tuple(sorted(other for other in reach[name] if name in reach[other])) for name in reach}
        return sorted(list(group) for group in groups if group)

    def _reached(self, start: str) -> set[str]:
        reached: set[str] = set()
        waiting = [start]
        while waiting:
            fresh = self.arrows[waiting.pop()] - reached
            reached |= fresh
            waiting += fresh
        return reached


def _floor(room: str) -> int:
    return next(level for level, floor in enumerate(FLOORS) if room in floor)


def _unit_floor(module: Module) -> int | None:
    """Return the floor of a module's unit in its room; None where the room has no floors."""
    floors = UNITS.get(module.room)
    if floors is None or (module.path.parent.name == module.room and module.is_package):
        return None
    for level, floor in enumerate(floors):
        if module.unit in floor:
            return level
    in_room_itself = len(module.package) == 1
    return next((level for level, floor in enumerate(floors) if "*" in floor and in_room_itself), None)


def imports_run_downwards(house: House) -> set[str]:
    """Rooms import lower rooms only."""
    found = set()
    for source, targets in house.arrows.items():
        for target in targets:
            here, there = house.modules[source].room, house.modules[target].room
            if here != there and _floor(there) >= _floor(here):
                found.add(f"{source} -> {target}")
    return found


def sub_rooms_run_downwards(house: House) -> set[str]:
    """Units import lower units of their room only."""
    found = set()
    for source, targets in house.arrows.items():
        for target in targets:
            here, there = house.modules[source], house.modules[target]
            if here.room != there.room or here.unit == there.unit:
                continue
            low, high = _unit_floor(there), _unit_floor(here)
            if low is None or high is None or low < high:
                continue
            if low > high or "*" not in UNITS[here.room][high]:
                found.add(f"{source} -> {target}")
    return found


def sub_rooms_have_floors(house: House) -> set[str]:
    """Every sub-room is on a floor of its room."""
    deep = {(module.room, module.unit) for module in house.modules.values() if len(module.package) > 1}
    known = {(room, unit) for room, floors in UNITS.items() for floor in floors for unit in floor}
    return {f"{room}/{unit}" for room, unit in deep - known}


def no_circles(house: House) -> set[str]:
    """No two modules reach each other by imports."""
    return {name for circle in house.circles for name in circle}


def one_name_per_room(house: House) -> set[str]:
    """No two files of a room have one name."""
    names = defaultdict(list)
    for module in house.modules.values():
        if not module.is_package:
            names[module.room, module.path.name].append(module.name)
    return {name for homes in names.values() if len(homes) > 1 for name in homes}


def modules_list_their_names(house: House) -> set[str]:
    """Every module has ``__all__``; package files that import nothing need none."""
    missing = (module for module in house.modules.values() if module.public is None)
    return {m.name for m in missing if m.path.name != "__main__.py" and not (m.is_package and not house.arrows[m.name])}


def names_are_listed_at_home(house: House) -> set[str]:
    """Only names in ``__all__`` of their module are imported."""
    found = set()
    for used in house.imports:
        public = house.modules[used.target].public
        if used.name and used.source != used.target and used.name not in (public or ()):
            found.add(f"{used.source} -> {used.target}: {used.name}")
    return found


def few_arguments(house: House) -> set[str]:
    """Functions take at most eight arguments, kernels included."""
    return {
        f"{module.name}: {name}"
        for module in house.modules.values()
        for name, count in module.functions
        if count > MOST_ARGUMENTS
    }


def short_modules(house: House) -> set[str]:
    """Modules have at most 450 lines."""
    return {module.name for module in house.modules.values() if module.lines > MOST_LINES}


def relative_imports(house: House) -> set[str]:
    """Modules import each other by relative names."""
    rooms = {room for floor in FLOORS for room in floor} | {"roofbench"}
    return {m.name for m in house.modules.values() for name, _ in m.foreign if name.split(".")[0] in rooms}


def detectors_do_not_draw(house: House) -> set[str]:
    """No module of the detectors imports matplotlib."""
    modules = (module for module in house.modules.values() if module.room == "detectors")
    return {m.name for m in modules for name, _ in m.foreign if name.split(".")[0] == "matplotlib"}


def one_home_for_kernels(house: House) -> set[str]:
    """Only core/kernels.py imports numba's compilers."""
    compilers = {"", "jit", "njit", "vectorize", "guvectorize", "cfunc", "stencil", "generated_jit"}
    return {
        module.name
        for module in house.modules.values()
        for name, attribute in module.foreign
        if name == "numba" and attribute in compilers and module.name != KERNELS
    }


def annotated_kernels(house: House) -> set[str]:
    """Kernels annotate every argument and what they return."""
    found = set()
    for module in house.modules.values():
        for node in ast.walk(module.tree):
            if not isinstance(node, ast.FunctionDef) or not any(map(_is_kernel, node.decorator_list)):
                continue
            given = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            if node.returns is None or any(argument.annotation is None for argument in given):
                found.add(f"{module.name}: {node.name}")
    return found


def _is_kernel(decorator: ast.expr) -> bool:
    """Return whether a decorator is ``kernel``, with or without options."""
    made = decorator.func if isinstance(decorator, ast.Call) else decorator
    return ast.unparse(made).split(".")[-1] == "kernel"


#: Words by which the docstring of a kernel says that it writes into an argument.
_CHANGES = re.compile(
    r"\b(in place|fill(s|ed)?|writes?|written|overwrit\w+|append(s|ed)?|advance[sd]?)\b", re.IGNORECASE
)


def kernels_say_what_they_change(house: House) -> set[str]:
    """Kernels that write into an argument say so in their docstring: fill, append, write, in place."""
    found = set()
    for module in house.modules.values():
        for node in ast.walk(module.tree):
            if isinstance(node, ast.FunctionDef) and any(map(_is_kernel, node.decorator_list)):
                given = {argument.arg for argument in node.args.args}
                if given & _written(node) and not _CHANGES.search(ast.get_docstring(node) or ""):
                    found.add(f"{module.name}: {node.name}")
    return found


def _written(function: ast.FunctionDef) -> set[str]:
    """Return the names whose elements a function sets and that it does not bind itself."""
    bound, written = set(), set()
    for node in ast.walk(function):
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        for item in [item for target in targets for item in getattr(target, "elts", [target])]:
            base = item
            while isinstance(base, ast.Attribute | ast.Subscript):
                base = base.value
            if isinstance(base, ast.Name):
                (bound if base is item else written).add(base.id)
    return written - bound


Rule = Callable[[House], set[str]]
RULES: tuple[Rule, ...] = (
    imports_run_downwards,
    sub_rooms_run_downwards,
    sub_rooms_have_floors,
    no_circles,
    one_name_per_room,
    relative_imports,
    modules_list_their_names,
    names_are_listed_at_home,
    few_arguments,
    short_modules,
    detectors_do_not_draw,
    one_home_for_kernels,
    annotated_kernels,
    kernels_say_what_they_change,
)


def picture(house: House) -> str:
    """Return the rooms by floor, from the top, with the arrows between rooms and between units, counted by files."""
    rooms: Counter[tuple[str, str]] = Counter()
    units: Counter[tuple[str, str, str]] = Counter()
    for source, targets in house.arrows.items():
        for target in targets:
            here, there = house.modules[source], house.modules[target]
            if here.room != there.room:
                rooms[here.room, there.room] += 1
            elif here.unit != there.unit:
                units[here.room, here.unit, there.unit] += 1
    files = Counter(module.room for module in house.modules.values())
    lines = [f"{len(house.modules)} modules; arrows with the number of imports between files", ""]
    for level, floor in reversed(list(enumerate(FLOORS))):
        for room in floor:
            below = [f"{there or 'root'} {count}" for (here, there), count in sorted(rooms.items()) if here == room]
            lines.append(f"floor {level}  {room or 'root'} ({files[room]} files) -> {', '.join(below) or 'nothing'}")
            for inner in reversed(range(len(UNITS.get(room, ())))):
                lines += _units_of(house, room, inner, units)
        lines.append("")
    broken = {rule.__name__: rule(house) for rule in RULES}
    up = sorted(broken["imports_run_downwards"] | broken["sub_rooms_run_downwards"])
    lines += ["arrows up: " + ("; ".join(up) or "none")]
    lines += ["circles: " + ("; ".join(", ".join(circle) for circle in house.circles) or "none")]
    lines += [f"{rule.__doc__} Broken {len(broken[rule.__name__])} times." for rule in RULES]
    return "\n".join(lines)


def _units_of(house: House, room: str, level: int, arrows: Counter[tuple[str, str, str]]) -> Iterator[str]:
    here = {module.unit for module in house.modules.values() if module.room == room and _unit_floor(module) == level}
    for unit in sorted(here):
        below = [
            f"{there} {count}" for (home, one, there), count in sorted(arrows.items()) if (home, one) == (room, unit)
        ]
        yield f"           {level}  {unit} -> {', '.join(below) or 'nothing of its room'}"


if __name__ == "__main__":
    print(picture(House()))
