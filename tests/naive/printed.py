"""The printed simulation, point by point: densities are multiplied as equations 6 and 8 to 16 print them."""

import math

import numpy as np

from naive.mpp import cells_inside
from roofbench.detectors.mpp.random_stream import gaussian, integer, uniform

#: Columns of a building and of its priors and steps.
LENGTH, WIDTH, ANGLE, NU, TAU = range(2, 7)


class Simulation:
    """Points, model and what an iteration asks of them."""

    def __init__(self, index, z, shape, model, plan):
        self.index, self.z, self.shape, self.model, self.plan = index, z, shape, model, plan
        self.classes = [tuple(pair) for pair in model.classes]

    def window(self, building):
        return cells_inside(building, *self.shape).ravel()[self.index]

    def density(self, chosen, mean, spread):
        """Equation 2, as the sum of the logarithms of equation 1."""
        terms = [-math.log(math.sqrt(2 * math.pi) * spread) - (z - mean) ** 2 / (2 * spread**2) for z in self.z[chosen]]
        return math.fsum(terms)

    def other(self, chosen):
        return max(self.density(chosen, *pair) for pair in self.classes)

    def marks(self, building):
        """P(B) exp(n / N), as a logarithm."""
        inside = self.z[self.window(building)]
        share = np.mean(np.abs(inside - building[NU]) <= self.model.match * building[TAU]) if len(inside) else 0.0
        return share + self.prior(building)

    def prior(self, building):
        marks = zip(building[[LENGTH, WIDTH, NU, TAU]], self.model.prior, strict=True)
        return sum(-((value - mean) ** 2) / (2 * spread**2) for value, (mean, spread) in marks)

    def update(self, new, old):
        """Equation 6."""
        after, before = self.window(new), self.window(old)
        if not after.any():
            return -math.inf
        ratio = self.density(after, *new[NU:]) - self.density(before, *old[NU:])
        if self.model.union:
            ratio += self.other(before & ~after) - self.other(after & ~before)
        return ratio + self.marks(new) - self.marks(old)

    def centre(self, new, old):
        """Equations 8 to 11: by class of the points that are left and of those taken in."""
        after, before = self.window(new), self.window(old)
        if not after.any():
            return False
        gained, left = after & ~before, before & ~after
        common = self.density(gained, *new[NU:]) - self.density(left, *old[NU:]) + self.marks(new) - self.marks(old)
        ground, tree = self.classes
        r1 = common + self.density(left, *ground) - self.density(gained, *ground)
        r2 = common + self.density(left, *tree) - self.density(gained, *ground)
        r3 = common + self.density(left, *ground) - self.density(gained, *tree)
        r4 = common + self.density(left, *tree) - self.density(gained, *tree)
        return (self.reaches(r1) and self.reaches(r3)) or (self.reaches(r2) and self.reaches(r4))

    def reaches(self, ratio):
        """Equation 7."""
        return min(1.0, math.exp(min(ratio, 0))) >= self.plan.false_alarm_ratio

    def birth(self, new):
        """Equations 14 and 15."""
        inside = self.window(new)
        if not inside.any():
            return False
        own = self.density(inside, *new[NU:]) + self.model.log_birth
        return all(self.reaches(own - self.density(inside, *pair)) for pair in self.classes)

    def death(self, building):
        """Equation 16."""
        inside = self.window(building)
        return self.reaches(self.other(inside) - self.density(inside, *building[NU:]) - self.model.log_birth)

    def posterior(self, buildings):
        """Equation 3 of a state, less what no building changes, with the Poisson term of the number."""
        windows = [self.window(building) for building in buildings]
        gains = [self.density(w, *b[NU:]) - self.other(w) for w, b in zip(windows, buildings, strict=True)]
        number = len(buildings) * math.log(self.plan.buildings) - math.lgamma(len(buildings) + 1)
        return sum(gains) + sum(map(self.prior, buildings)) + number

    def drawn(self, buildings, state):
        """A new building: angle and marks from the priors, a centre outside the others."""
        new = np.zeros(7)
        new[ANGLE] = uniform(state) * math.pi
        for (mean, spread), column in zip(self.model.prior, (LENGTH, WIDTH, NU, TAU), strict=True):
            new[column] = mean + spread * gaussian(state)
        new[[LENGTH, WIDTH]] = np.clip(new[[LENGTH, WIDTH]], *self.plan.sides)
        new[TAU] = max(new[TAU], 0.05)
        for _ in range(100):
            new[0], new[1] = uniform(state) * self.shape[1], uniform(state) * self.shape[0]
            if not any(self.holds(other, new[0], new[1]) for other in buildings):
                return new
        return None

    @staticmethod
    def holds(building, x, y):
        dx, dy, cos, sin = x - building[0], y - building[1], math.cos(building[ANGLE]), math.sin(building[ANGLE])
        return abs(dx * cos + dy * sin) < building[LENGTH] / 2 and abs(dy * cos - dx * sin) < building[WIDTH] / 2

    def changed(self, old, state):
        """Figure 2, and nu and tau."""
        new = old.copy()
        new[NU] += self.plan.steps[3] * gaussian(state)
        new[TAU] = max(new[TAU] + self.plan.steps[4] * gaussian(state), 0.05)
        kind = integer(state, 5)
        if kind == 4:
            new[ANGLE] = (new[ANGLE] + self.plan.steps[2] * gaussian(state)) % math.pi
            return new
        axis = integer(state, 2)
        size = abs(self.plan.steps[axis] * gaussian(state)) * (1 if kind in (0, 2) else -1)
        side = new[LENGTH + axis]
        new[LENGTH + axis] = np.clip(side + size, *self.plan.sides)
        if kind >= 2:
            end = (-1) ** integer(state, 2) * (new[LENGTH + axis] - side) / 2
            cos, sin = math.cos(new[ANGLE]), math.sin(new[ANGLE])
            new[:2] += end * np.array([(cos, sin), (-sin, cos)][axis])
        return new

    def moved(self, old, state):
        new = old.copy()
        along, across = (uniform(state) - 0.5) * old[LENGTH], (uniform(state) - 0.5) * old[WIDTH]
        cos, sin = math.cos(old[ANGLE]), math.sin(old[ANGLE])
        new[:2] += along * cos - across * sin, along * sin + across * cos
        return new

    def on_grid(self, building):
        return 0 <= building[0] < self.shape[1] and 0 <= building[1] < self.shape[0]


def run(index, z, shape, model, plan, state):
    """Return the best state and whether update, centre, birth and death were accepted in each iteration.

    The schedule must have no least nu, prior limit or overlap share.
    """
    simulation = Simulation(index, z, shape, model, plan)
    buildings = [simulation.drawn([], state)]
    best, value, accepted = [], -math.inf, np.zeros((plan.iterations, 4))
    for t in range(plan.iterations):
        if buildings:
            i = integer(state, len(buildings))
            new = simulation.changed(buildings[i], state)
            if simulation.reaches(simulation.update(new, buildings[i])) and simulation.on_grid(new):
                buildings[i], accepted[t, 0] = new, 1
            i = integer(state, len(buildings))
            new = simulation.moved(buildings[i], state)
            if simulation.centre(new, buildings[i]) and simulation.on_grid(new):
                buildings[i], accepted[t, 1] = new, 1
        if uniform(state) < plan.birth_share:
            new = simulation.drawn(buildings, state)
            if new is not None and simulation.birth(new):
                buildings.append(new)
                accepted[t, 2] = 1
        elif buildings:
            i = integer(state, len(buildings))
            if simulation.death(buildings[i]):
                buildings[i] = buildings[-1]
                buildings.pop()
                accepted[t, 3] = 1
        now = simulation.posterior(buildings)
        if now > value + 1e-12:
            best, value = [building.copy() for building in buildings], now
    return np.array(best).reshape(-1, 7), accepted
