"""Slow obvious oracle of the points per square."""


def point_counts(x, y, grid):
    return [
        [
            sum(
                grid.west + c * grid.gsd <= px < grid.west + (c + 1) * grid.gsd
                and grid.north - (r + 1) * grid.gsd < py <= grid.north - r * grid.gsd
                for px, py in zip(x, y, strict=True)
            )
            for c in range(grid.columns)
        ]
        for r in range(grid.rows)
    ]
