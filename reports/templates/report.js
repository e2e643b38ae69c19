"use strict";
// Draws the scenes of the report. Everything comes from the JSON in the page; text goes in by textContent only.

const SVG = "http://www.w3.org/2000/svg";
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}

function shape(name, attributes = {}) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  return made;
}

// A reason travels as the number of its phrase and the numbers that belong between its parts.
function reason(coded) {
  const [phrase, ...numbers] = coded.split(" ");
  const text = data.phrases[phrase].reduce((said, part, place) => said + numbers[place - 1] + part);
  return text.replaceAll(" %", "\u00a0%"); // a number is not separated from its unit
}

// ---- theme ---------------------------------------------------------------------------------------------------------

byId("theme").addEventListener("click", () => {
  const root = document.documentElement;
  const dark = root.dataset.theme
    ? root.dataset.theme === "dark"
    : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = dark ? "light" : "dark";
});

// ---- tables --------------------------------------------------------------------------------------------------------

function sortTable(table, column, descending) {
  const body = table.tBodies[0];
  const rows = [...body.rows];
  const key = (row) => row.cells[column].dataset.value ?? row.cells[column].textContent.trim();
  const sign = descending ? -1 : 1;
  rows.sort((a, b) => {
    const [x, y] = [key(a), key(b)];
    if (x === "" || y === "") return (x === "") - (y === ""); // undefined values stay at the end
    const [m, n] = [Number(x), Number(y)];
    return sign * (Number.isNaN(m) || Number.isNaN(n) ? x.localeCompare(y) : m - n);
  });
  body.append(...rows);
}

for (const button of document.querySelectorAll("button.sort")) {
  const head = button.closest("th");
  button.addEventListener("click", () => {
    const before = head.getAttribute("aria-sort");
    const descending = before ? before === "ascending" : head.dataset.first === "descending";
    for (const other of head.closest("thead").querySelectorAll("th[aria-sort]")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", descending ? "descending" : "ascending");
    sortTable(head.closest("table"), Number(head.dataset.column), descending);
  });
}

for (const group of document.querySelectorAll(".segmented[data-board]")) {
  const table = byId(group.dataset.board);
  for (const button of group.children) {
    button.addEventListener("click", () => {
      table.dataset.pooling = button.value;
      for (const other of group.children) other.setAttribute("aria-pressed", other === button);
    });
  }
}

// ---- scenes --------------------------------------------------------------------------------------------------------

const UNIT = 0.1; // metres per unit of the drawings
const DASHES = ["", "7 4", "2 3", "10 3 2 3"];
const SIDES = ["detections", "references"];
// Filled kinds of a side in drawing order: those that are hidden at first, below, then as declared.
const filled = (side) => data.kinds.map((_, number) => number)
  .filter((number) => data.kinds[number].filled && data.kinds[number].side === side)
  .sort((one, two) => data.kinds[two].hidden - data.kinds[one].hidden);
// Kinds with one key on both sides are switched together.
const keys = [...new Set(data.kinds.filter((kind) => kind.filled).map((kind) => kind.key))];

function hatch(number, colour) {
  const pattern = shape("pattern", {
    id: `hatch-${number}`, width: 8, height: 8, patternUnits: "userSpaceOnUse", patternTransform: "rotate(45)",
  });
  pattern.append(
    shape("rect", { width: 8, height: 8, fill: colour, "fill-opacity": 0.25 }),
    shape("rect", { width: 3, height: 8, fill: colour }),
  );
  return pattern;
}

function paint(path, number, dash) {
  const { colour, hatched, opacity } = data.kinds[number];
  path.setAttribute("fill", hatched ? `url(#hatch-${number})` : colour);
  path.setAttribute("fill-opacity", opacity);
  path.setAttribute("stroke", colour);
  path.setAttribute("stroke-width", 2);
  if (dash) path.setAttribute("stroke-dasharray", dash);
}

function swatchOf(kind) {
  const swatch = element("span", { class: kind.hatched ? "swatch hatched" : "swatch" });
  swatch.style.setProperty("--colour", kind.colour);
  return swatch;
}

class Viewer {
  constructor(frame) {
    this.frame = frame;
    this.svg = frame.querySelector("svg");
    this.layers = {};
    for (const name of ["picture", "references", "shapes", "chosen"]) {
      this.layers[name] = shape("g");
    }
    const definitions = shape("defs");
    data.kinds.forEach((kind, number) => {
      if (kind.hatched) definitions.append(hatch(number, kind.colour));
    });
    this.svg.append(definitions, ...Object.values(this.layers));
    this.hidden = { overlays: new Set(), verdicts: new Set(data.kinds.filter((kind) => kind.hidden).map((kind) => kind.key)) };
    this.labels = null;
    this.pointers = new Map();
    this.listen();
  }

  // -- what is shown

  open(number) {
    this.number = number;
    this.scene = data.scenes[number];
    byId("scene").value = number;
    // Detectors stay switched as they were when the next scene has them, too.
    const wanted = this.labels;
    const labels = this.scene.overlays.map((overlay) => overlay.label);
    this.hidden.overlays = new Set(
      [...labels.keys()].filter((place) => (wanted ? !wanted.has(labels[place]) : place > 0)),
    );
    if (this.hidden.overlays.size === labels.length) this.hidden.overlays.delete(0);
    const { width, height } = this.scene;
    this.frame.style.aspectRatio = Math.min(Math.max(width / height, 0.75), 2.2);
    this.draw();
    this.choose(null);
    this.fit();
  }

  draw() {
    const { scene, layers } = this;
    for (const layer of Object.values(layers)) layer.replaceChildren();
    if (scene.picture) {
      layers.picture.append(shape("image", {
        href: scene.picture, width: scene.width, height: scene.height, preserveAspectRatio: "none",
      }));
    }
    const known = scene.paths.join("");
    layers.references.append(shape("path", { d: known, class: "known under" }), shape("path", { d: known, class: "known" }));
    if (scene.border) layers.references.append(shape("path", { d: scene.border, class: "border" }));
    scene.overlays.forEach((overlay, place) => {
      const group = shape("g", { "data-overlay": place });
      this.append(group, place, "references", scene.paths, overlay.references);
      this.append(group, place, "detections", overlay.paths, overlay.detections);
      layers.shapes.append(group);
    });
    byId("shows").textContent = [scene.shows, `${(scene.width * UNIT).toFixed(0)} × ${(scene.height * UNIT).toFixed(0)} m`]
      .filter(Boolean).join(" · ");
    this.toggles();
    this.refresh();
  }

  append(group, place, side, paths, rows) {
    // One kind after the other, so that what is wrong lies on top.
    for (const number of filled(side)) {
      paths.forEach((d, position) => {
        if (rows.verdicts[position] !== number) return;
        const path = shape("path", {
          d, class: "shape", "data-verdict": data.kinds[number].key, "data-side": side, "data-position": position,
        });
        paint(path, number, DASHES[place % DASHES.length]);
        group.append(path);
      });
    }
  }

  toggles() {
    const { scene, hidden } = this;
    const detectors = byId("detectors");
    detectors.replaceChildren(element("legend", {}, "Detectors"));
    scene.overlays.forEach((overlay, place) => {
      const box = element("input", { type: "checkbox", "data-overlay": place });
      box.checked = !hidden.overlays.has(place);
      box.addEventListener("change", () => {
        hidden.overlays[box.checked ? "delete" : "add"](place);
        this.labels = new Set(
          scene.overlays.filter((_, other) => !hidden.overlays.has(other)).map((other) => other.label),
        );
        this.refresh();
      });
      const label = element("span", { class: "text clip", title: overlay.label }, overlay.label);
      const right = this.total(overlay, (kind) => kind.filled && kind.correct);
      const wrong = this.total(overlay, (kind) => kind.error);
      const count = element("span", { class: "count" }, `${right} right, ${wrong} wrong`);
      detectors.append(element("label", { class: "toggle" }, box, element("span", { class: `dash d${place % 4}` }), label, count));
    });
    const verdicts = byId("verdicts");
    verdicts.replaceChildren(element("legend", {}, "Verdicts"));
    for (const verdict of keys) {
      const kind = data.kinds.find((other) => other.filled && other.key === verdict);
      const there = scene.overlays.some((overlay) => this.count(overlay, verdict));
      if (!there) continue;
      const box = element("input", { type: "checkbox", "data-verdict": verdict });
      box.checked = !hidden.verdicts.has(verdict);
      box.addEventListener("change", () => {
        hidden.verdicts[box.checked ? "delete" : "add"](verdict);
        this.refresh();
      });
      verdicts.append(element("label", { class: "toggle" }, box, swatchOf(kind), element("span", { class: "text" }, kind.legend),
        element("span", { class: "count", "data-count": verdict })));
    }
  }

  total(overlay, wanted) {
    return SIDES.reduce((sum, side) => sum + overlay[side].verdicts.filter((number) => wanted(data.kinds[number])).length, 0);
  }

  count(overlay, verdict) {
    return this.total(overlay, (kind) => kind.filled && kind.key === verdict);
  }

  visible(place, verdict) {
    return !this.hidden.overlays.has(place) && !this.hidden.verdicts.has(verdict);
  }

  refresh() {
    for (const group of this.layers.shapes.children) {
      const place = Number(group.dataset.overlay);
      group.style.display = this.hidden.overlays.has(place) ? "none" : "";
      for (const path of group.children) {
        path.style.display = this.hidden.verdicts.has(path.dataset.verdict) ? "none" : "";
      }
    }
    for (const cell of document.querySelectorAll("[data-count]")) {
      const counts = this.scene.overlays
        .filter((_, place) => !this.hidden.overlays.has(place))
        .map((overlay) => this.count(overlay, cell.dataset.count));
      cell.textContent = counts.join(" / ");
    }
  }

  // -- one object

  choose(object, { jump = false } = {}) {
    const { scene, layers } = this;
    this.chosen = object;
    layers.chosen.replaceChildren();
    const panel = byId("detail");
    if (!object) {
      panel.replaceChildren(element("p", { class: "soft" }, "Click an object on the map, or step through the errors, to read why it counts as it does."));
      return;
    }
    const overlay = scene.overlays[object.overlay];
    const detection = object.side === "detections";
    const rows = overlay[object.side];
    const own = detection ? overlay : scene;
    const other = detection ? scene : overlay;
    const { position } = object;
    const kind = data.kinds[rows.verdicts[position]];
    const partner = rows.partners[position];
    const mate = partner === null ? -1 : other.ids.indexOf(partner);
    if (mate >= 0) this.outline(other.paths[mate], true);
    this.outline(own.paths[position], false);

    const facts = [
      [detection ? "detection" : "reference", `number ${own.ids[position]}`],
      ["area", own.areas[position], "m²", 1],
      [detection ? "nearest reference" : "nearest detection", partner === null ? "none" : `number ${partner}`],
      ...data.measures.map(({ title, unit, decimals }, number) => [title, rows.measures[number][position], unit, decimals]),
    ];
    const list = element("dl");
    for (const [name, value, unit, digits] of facts) {
      if (value === null || value === undefined) continue;
      const text = typeof value === "number" ? `${value.toFixed(digits)} ${unit}`.trim() : value;
      list.append(element("dt", {}, name), element("dd", {}, text));
    }
    panel.replaceChildren(
      element("div", { class: "chip" }, swatchOf(kind), kind.legend),
      element("p", { class: "soft small clip", title: overlay.label }, `${overlay.label}, run ${overlay.run}`),
      element("p", { class: "reason" }, reason(rows.reasons[position])),
      list,
    );
    if (jump) this.jump(own.paths[position]);
  }

  outline(d, partner) {
    const extra = partner ? " partner" : "";
    this.layers.chosen.append(
      shape("path", { d, class: `chosen${extra}` }), shape("path", { d, class: `chosen inner${extra}` }),
    );
  }

  errors() {
    const found = [];
    this.scene.overlays.forEach((overlay, place) => {
      for (const [side, own] of [["detections", overlay], ["references", this.scene]]) {
        overlay[side].verdicts.forEach((number, position) => {
          if (data.kinds[number].error && this.visible(place, data.kinds[number].key)) {
            found.push({ overlay: place, side, position, area: own.areas[position] });
          }
        });
      }
    });
    return found.sort((a, b) => b.area - a.area);
  }

  step(by) {
    const errors = this.errors();
    if (!errors.length) return;
    const same = (one) => this.chosen && ["overlay", "side", "position"].every((key) => one[key] === this.chosen[key]);
    const here = errors.findIndex(same);
    const next = here < 0 ? (by > 0 ? 0 : errors.length - 1) : (here + by + errors.length) % errors.length;
    this.choose(errors[next], { jump: true });
  }

  // -- where one looks

  fit() {
    this.view = this.whole();
    this.apply();
  }

  whole() {
    const { width, height } = this.scene;
    const box = this.svg.getBoundingClientRect();
    const scale = Math.max(width / (box.width || 1), height / (box.height || 1)) * 1.02;
    const [w, h] = [box.width * scale, box.height * scale];
    return { x: (width - w) / 2, y: (height - h) / 2, scale };
  }

  apply() {
    const box = this.svg.getBoundingClientRect();
    const { x, y, scale } = this.view;
    this.svg.setAttribute("viewBox", `${x} ${y} ${box.width * scale || 1} ${box.height * scale || 1}`);
    this.svg.classList.toggle("zoomed", scale < this.whole().scale * 0.99);
    // The hatching keeps its width on the screen.
    for (const pattern of this.svg.querySelectorAll("pattern")) {
      pattern.setAttribute("patternTransform", `scale(${scale}) rotate(45)`);
    }
    const metres = scale * UNIT * 110;
    const power = 10 ** Math.floor(Math.log10(metres));
    const length = [5, 2, 1].map((step) => step * power).find((step) => step <= metres);
    const rule = byId("rule");
    rule.textContent = length >= 1000 ? `${length / 1000} km` : `${length} m`;
    rule.style.setProperty("--length", `${length / (scale * UNIT)}px`);
  }

  zoom(factor, clientX, clientY) {
    const box = this.svg.getBoundingClientRect();
    const [px, py] = clientX === undefined ? [box.width / 2, box.height / 2] : [clientX - box.left, clientY - box.top];
    const whole = this.whole().scale;
    const scale = Math.min(whole, Math.max(whole / 60, this.view.scale / factor));
    if (scale >= whole * 0.999) return this.fit();
    this.view.x += px * (this.view.scale - scale);
    this.view.y += py * (this.view.scale - scale);
    this.view.scale = scale;
    this.apply();
  }

  pan(dx, dy) {
    const { width, height } = this.scene;
    const box = this.svg.getBoundingClientRect();
    const { view } = this;
    const inside = (value, size, seen) => Math.min(Math.max(value, -seen / 2), size - seen / 2);
    view.x = inside(view.x - dx * view.scale, width, box.width * view.scale);
    view.y = inside(view.y - dy * view.scale, height, box.height * view.scale);
    this.apply();
  }

  jump(d) {
    const probe = shape("path", { d });
    this.layers.chosen.append(probe);
    const { x, y, width, height } = probe.getBBox();
    probe.remove();
    const box = this.svg.getBoundingClientRect();
    const room = Math.max(5 * Math.max(width, height), 400);
    const scale = Math.min(this.whole().scale, room / Math.min(box.width, box.height));
    this.view = { x: x + width / 2 - (box.width * scale) / 2, y: y + height / 2 - (box.height * scale) / 2, scale };
    this.apply();
  }

  listen() {
    const { svg, pointers } = this;
    svg.addEventListener("wheel", (event) => {
      const out = event.deltaY > 0;
      if (out && !svg.classList.contains("zoomed")) return; // all is seen: let the page scroll
      event.preventDefault();
      this.zoom(Math.exp(-Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 120) * 0.0022), event.clientX, event.clientY);
    }, { passive: false });
    svg.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (pointers.size === 1) {
        this.moved = 0;
        this.pressed = event.target;
      }
    });
    svg.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const now = { x: event.clientX, y: event.clientY };
      this.moved += Math.hypot(now.x - before.x, now.y - before.y);
      if (pointers.size === 2) {
        const [other] = [...pointers].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
        const apart = (point) => Math.hypot(point.x - other.x, point.y - other.y) || 1;
        this.zoom(apart(now) / apart(before), (now.x + other.x) / 2, (now.y + other.y) / 2);
      } else if (this.moved > 4 && (event.pointerType === "mouse" || svg.classList.contains("zoomed"))) {
        if (!svg.hasPointerCapture(event.pointerId)) svg.setPointerCapture(event.pointerId);
        svg.classList.add("dragging");
        this.pan(now.x - before.x, now.y - before.y);
      }
      pointers.set(event.pointerId, now);
    });
    const end = (event) => {
      if (!pointers.delete(event.pointerId)) return;
      svg.classList.remove("dragging");
      if (event.type === "pointerup" && this.moved <= 4 && !pointers.size) this.clicked(this.pressed);
    };
    svg.addEventListener("pointerup", end);
    svg.addEventListener("pointercancel", end);
    svg.addEventListener("dblclick", (event) => this.zoom(2, event.clientX, event.clientY));
    svg.addEventListener("keydown", (event) => {
      const step = 60;
      const moves = { ArrowLeft: [step, 0], ArrowRight: [-step, 0], ArrowUp: [0, step], ArrowDown: [0, -step] };
      if (moves[event.key]) this.pan(...moves[event.key]);
      else if (event.key === "+" || event.key === "=") this.zoom(1.5);
      else if (event.key === "-") this.zoom(1 / 1.5);
      else if (event.key === "0") this.fit();
      else return;
      event.preventDefault();
    });
    new ResizeObserver(() => this.scene && this.fit()).observe(this.frame);
    byId("zoom-in").addEventListener("click", () => this.zoom(1.6));
    byId("zoom-out").addEventListener("click", () => this.zoom(1 / 1.6));
    byId("zoom-fit").addEventListener("click", () => this.fit());
    byId("next-error").addEventListener("click", () => this.step(1));
    byId("previous-error").addEventListener("click", () => this.step(-1));
    byId("scene").addEventListener("change", (event) => this.open(Number(event.target.value)));
    const count = data.scenes.length;
    byId("next-scene").addEventListener("click", () => this.open((this.number + 1) % count));
    byId("previous-scene").addEventListener("click", () => this.open((this.number + count - 1) % count));
    for (const button of byId("backdrop").children) {
      button.addEventListener("click", () => {
        this.frame.classList.remove("pale", "bare");
        if (button.value) this.frame.classList.add(button.value);
        for (const other of byId("backdrop").children) other.setAttribute("aria-pressed", other === button);
      });
    }
  }

  clicked(target) {
    if (!target.classList.contains("shape")) return this.choose(null);
    this.choose({
      overlay: Number(target.parentNode.dataset.overlay),
      side: target.dataset.side,
      position: Number(target.dataset.position),
    });
  }
}

// ---- gallery -------------------------------------------------------------------------------------------------------

function card(error, viewer) {
  const scene = data.scenes[error.scene];
  const overlay = scene.overlays[error.overlay];
  const side = error.side === "detection" ? "detections" : "references";
  const rows = overlay[side];
  const number = rows.verdicts[error.position];
  const kind = data.kinds[number];
  const [x, y, size] = error.box;
  const svg = shape("svg", { viewBox: `${x} ${y} ${size} ${size}`, "aria-hidden": "true" });
  if (error.picture) svg.append(shape("image", { href: error.picture, x, y, width: size, height: size }));
  svg.append(shape("path", { d: scene.paths.join(""), class: "known under" }), shape("path", { d: scene.paths.join(""), class: "known" }));
  const path = shape("path", { d: (side === "detections" ? overlay : scene).paths[error.position], class: "shape" });
  paint(path, number, "");
  svg.append(path);
  const text = element("span", { class: "text" },
    element("span", { class: "chip" }, swatchOf(kind), `${kind.key}, ${error.wrong} m² wrong`),
    element("b", { class: "clip", title: overlay.label }, overlay.label),
    element("span", {}, reason(rows.reasons[error.position])),
    element("span", { class: "soft clip", title: scene.name }, scene.name));
  const button = element("button", { class: "worst", type: "button" }, svg, text);
  button.addEventListener("click", () => {
    viewer.labels = new Set([overlay.label]);
    viewer.hidden.verdicts.delete(kind.key);
    viewer.open(error.scene);
    viewer.choose({ overlay: error.overlay, side, position: error.position }, { jump: true });
    byId("scenes").scrollIntoView();
  });
  return button;
}

if (data.scenes.length) {
  const viewer = new Viewer(byId("frame"));
  viewer.open(0);
  for (const error of data.errors) byId("gallery").append(card(error, viewer));
  for (const button of document.querySelectorAll("button.open")) {
    button.addEventListener("click", () => {
      viewer.open(Number(button.value));
      byId("viewer").scrollIntoView();
    });
  }
}
