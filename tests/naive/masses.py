"""Dempster's rule for one cell, by enumeration of all pairs of sets of classes."""


def combined(pieces, classes=4):
    """Return masses by set and the total conflict; `pieces` are mappings of a set (bits) to its mass."""
    sets = range(1 << classes)
    everything = (1 << classes) - 1
    total, agreed = {everything: 1.0}, 1.0
    for piece in pieces:
        joint = {
            wanted: sum(
                total.get(one, 0.0) * piece.get(two, 0.0) for one in sets for two in sets if one & two == wanted
            )
            for wanted in sets
        }
        conflict = joint[0]
        agreed *= 1 - conflict
        if conflict >= 1 - 1e-6:
            total = {everything: 1.0}
            continue
        total = {held: mass / (1 - conflict) for held, mass in joint.items() if held}
    return total, 1 - agreed


def support(masses, classes):
    """Return the masses of all subsets of a set."""
    return sum(mass for held, mass in masses.items() if held and held & ~classes == 0)
