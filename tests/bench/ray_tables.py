"""Tables and a plot of the reports that embree_bench writes. Nothing here measures.

A report is the dictionary {"head": {...}, "builds": [...], "traversal": [...], "answers": [...]} of
one mesh; `reports` maps mesh names to them. Rates are million rays a second; a ratio above 1 means
that Glint is ahead.
"""

from __future__ import annotations

from statistics import median

KINDS = ("primary", "camera", "shadow", "mirror", "diffuse")
"""camera: the primary rays, made by Glint's core while the clock runs, beside Embree's from arrays.
"""
TARGETS = {
    "robust": dict(zip(KINDS, (2.5, 1.7, 1.5, 1.2, 1.1), strict=True)),
    "fast": dict(zip(KINDS, (1.7, 1.7, 1.1, 1.0, 1.0), strict=True)),
}
"""The least that the medians over the meshes should be, against Embree's best watertight and best
other mode.
"""
WORST_TARGET = 0.95
"""On no mesh below that, against the best watertight mode."""
THREADS_TARGET = 1.9
BUILD_TARGETS = {"balanced": 2.0, "fast": 6.0}
"""Million triangles a second and core, of the default build and of the viewport's."""


def best(report: dict, kind: str, threads: int, tracer: str, robust: bool = False) -> dict | None:
    """The fastest row of a tracer; None when there is none. robust: of the watertight modes, else
    of all. Embree's camera rays are the primary ones.
    """
    rays = "primary" if (kind, tracer) == ("camera", "embree") else kind
    rows = [
        row
        for row in report.get("traversal", ())
        if (row["rays"], row["threads"], row["tracer"]) == (rays, threads, tracer)
        and (row["robust"] or not robust)
    ]
    return max(rows, key=lambda row: row["mrays"], default=None)


def ratio(report: dict, kind: str, threads: int, robust: bool) -> float | None:
    """Glint over Embree's best watertight mode (robust), or over its best of all; None when either
    was not measured.
    """
    ours, theirs = (
        best(report, kind, threads, "glint"),
        best(report, kind, threads, "embree", robust),
    )
    return ours["mrays"] / theirs["mrays"] if ours and theirs else None


def ratios(reports: dict[str, dict], kind: str, threads: int, robust: bool) -> dict[str, float]:
    """Mesh → ratio, of the meshes that have one."""
    found = {name: ratio(report, kind, threads, robust) for name, report in reports.items()}
    return {name: value for name, value in found.items() if value is not None}


def scaling(reports: dict[str, dict], kind: str, tracer: str = "glint") -> list[float]:
    """Rates of two threads over one."""
    pairs = [
        (best(report, kind, 2, tracer), best(report, kind, 1, tracer))
        for report in reports.values()
    ]
    return [two["mrays"] / one["mrays"] for two, one in pairs if two and one]


def verdict(value: float, target: float) -> str:
    """`met` or `missed`; NaN has missed."""
    return "met" if value >= target else "missed"


def table(rows: list[tuple[str, ...]]) -> str:
    """Columns as wide as they need, the first to the left, the others to the right; the first row
    is the heading.
    """
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = [
        "  ".join(
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]
    return "\n".join([lines[0], "-" * len(lines[0]), *lines[1:]])


def rates_table(reports: dict[str, dict], threads: int) -> str:
    """Per mesh and ray kind: Glint, Embree's best watertight and fast modes, and the ratios."""
    rows = [
        (
            "mesh, rays",
            "Glint",
            "Embree robust",
            "mode",
            "ratio",
            "Embree fast",
            "mode",
            "ratio",
            "hits differ /M",
        )
    ]
    for name, report in reports.items():
        for kind in KINDS:
            ours = best(report, kind, threads, "glint")
            if not ours:
                continue
            cells = [f"{name}, {kind}", f"{ours['mrays']:.1f}"]
            for robust in (True, False):
                theirs = best(report, kind, threads, "embree", robust)
                cells += (
                    [
                        f"{theirs['mrays']:.1f}",
                        theirs["mode"],
                        f"{ours['mrays'] / theirs['mrays']:.2f}",
                    ]
                    if theirs
                    else ["-", "-", "-"]
                )
            rows.append((*cells, "-" if kind == "camera" else f"{differing(report, kind):.1f}"))
    return table(rows)


def differing(report: dict, kind: str) -> float:
    """Rays per million for which Glint and Embree see a different thing: hit against miss, or
    another distance.
    """
    return sum(
        row["hit_or_miss_per_million"] + row["distance_per_million"]
        for row in report.get("answers", ())
        if row["rays"] == kind
    )


def summary_table(reports: dict[str, dict]) -> str:
    """Median and worst ratios per ray kind beside the targets (one thread), and the gain of a
    second thread.
    """
    rows = [("rays, against", "median", "target", "", "worst", "mesh", "floor", "")]
    for robust in (True, False):
        for kind in KINDS:
            values = ratios(reports, kind, 1, robust)
            rows += [summary_row(kind, robust, values)] if values else []
    for kind in KINDS:
        gains = scaling(reports, kind)
        if gains:
            middle = median(gains)
            rows.append(
                (
                    f"{kind}, 2 threads over 1",
                    f"{middle:.2f}",
                    f"{THREADS_TARGET}",
                    verdict(middle, THREADS_TARGET),
                    *4 * ("",),
                )
            )
    return table([*rows, *build_summary(reports)])


def build_summary(reports: dict[str, dict]) -> list[tuple[str, ...]]:
    """Rows of the summary: the balanced build beside Embree's medium watertight one, the tree of
    like quality; speeds and bytes as ratios, above 1 where Glint is ahead.
    """
    rows = []
    for text, number in (("build speed", "cpu_seconds"), ("bytes saved", "bytes_per_triangle")):
        found = {name: build_ratio(report, number) for name, report in reports.items()}
        values = {name: value for name, value in found.items() if value}
        if values:
            middle, worst = median(values.values()), min(values, key=values.get)
            cells = (
                f"{middle:.2f}",
                "1.0",
                verdict(middle, 1.0),
                f"{values[worst]:.2f}",
                worst,
                "1.0",
                verdict(values[worst], 1.0),
            )
            rows.append((f"{text}, Embree medium robust", *cells))
    return rows


def build_ratio(report: dict, number: str) -> float | None:
    """Embree's medium watertight build over Glint's balanced one, on one thread; None when either
    was not measured.
    """
    rows = {build_name(row): row[number] for row in report.get("builds", ()) if row["threads"] == 1}
    ours, theirs = rows.get("glint balanced"), rows.get("embree medium robust")
    return theirs / ours if ours and theirs else None


def summary_row(kind: str, robust: bool, values: dict[str, float]) -> tuple[str, ...]:
    """values: mesh → ratio, at least one."""
    name = "robust" if robust else "fast"
    middle, worst, target = (
        median(values.values()),
        min(values, key=values.get),
        TARGETS[name][kind],
    )
    floor = (f"{WORST_TARGET}", verdict(values[worst], WORST_TARGET)) if robust else ("", "")
    return (
        f"{kind}, Embree {name}",
        f"{middle:.2f}",
        f"{target}",
        verdict(middle, target),
        f"{values[worst]:.2f}",
        worst,
        *floor,
    )


def builds_table(reports: dict[str, dict]) -> str:
    """Build speed per core (processor time, one thread), the gain of two threads, and bytes per
    triangle.
    """
    rows = [
        (
            "mesh, build",
            "M triangles/s/core",
            "ms",
            "2 threads: ms",
            "bytes/triangle",
            "balanced Glint's speed over it",
            "its bytes",
        )
    ]
    for name, report in reports.items():
        single = [row for row in report.get("builds", ()) if row["threads"] == 1]
        glint = next((row for row in single if build_name(row) == "glint balanced"), None)
        if glint:
            rows += [
                (f"{name}, {build_name(row)}", *build_cells(report, row, glint)) for row in single
            ]
    wanted = " and ".join(f"{speed} {name}" for name, speed in BUILD_TARGETS.items())
    targets = (
        f"targets: {wanted}, million triangles a second and core; Glint's bytes at most 1, "
        "wished 0.5 of Embree's"
    )
    return f"{table(rows)}\n{targets}"


def build_name(row: dict) -> str:
    return " ".join(
        [
            row["tracer"],
            row["quality"],
            *(word for word in ("robust", "compact") if row[word] and row["tracer"] == "embree"),
        ]
    )


def build_cells(report: dict, row: dict, glint: dict) -> tuple[str, ...]:
    """The numbers of one build; `glint`: the row to compare with."""
    speed = report["head"]["triangles"] / row["cpu_seconds"] / 1e6
    two = next(
        (r for r in report["builds"] if r["threads"] == 2 and build_name(r) == build_name(row)),
        None,
    )
    return (
        f"{speed:.2f}",
        f"{1e3 * row['cpu_seconds']:.1f}",
        f"{1e3 * two['wall_seconds']:.1f}" if two else "-",
        f"{row['bytes_per_triangle']:.1f}",
        f"{row['cpu_seconds'] / glint['cpu_seconds']:.2f}",
        f"{glint['bytes_per_triangle'] / row['bytes_per_triangle']:.2f}",
    )


def plot(reports: dict[str, dict]) -> str:
    """An SVG: a group of bars per ray kind, a bar per mesh: Glint over Embree's best watertight
    mode, one thread; a line at 1.
    """
    names, bar, gap, height = list(reports), 14, 30, 300
    values = {kind: ratios(reports, kind, 1, True) for kind in KINDS}
    top = max([1.0, *(v for group in values.values() for v in group.values())]) * 1.1
    group_width = bar * len(names) + gap
    parts = []
    for g, kind in enumerate(KINDS):
        left = 60 + g * group_width
        parts.append(f'<text x="{left}" y="{height + 40}">{kind}</text>')
        for k, name in enumerate(names):
            tall = height * values[kind].get(name, 0.0) / top
            place = (
                f'x="{left + k * bar}" y="{20 + height - tall:.1f}" width="{bar - 2}" '
                f'height="{tall:.1f}"'
            )
            title = f"{name}: {values[kind].get(name, 0.0):.2f}"
            parts.append(
                f"<rect {place} "
                f'fill="hsl({360 * k // len(names)},60%,50%)"><title>{title}</title></rect>'
            )
    right = 60 + group_width * len(KINDS)
    one = 20 + height - height / top
    parts.append(
        f'<line x1="50" x2="{right}" y1="{one:.1f}" y2="{one:.1f}" stroke="black"/><text x="30" '
        f'y="{one + 4:.1f}">1</text>'
    )
    for k, name in enumerate(names):
        row = 30 + 16 * k
        parts.append(
            f'<rect x="{right + 10}" y="{row - 10}" width="10" height="10" '
            f'fill="hsl({360 * k // len(names)},60%,50%)"/>'
        )
        parts.append(f'<text x="{right + 26}" y="{row}">{name}</text>')
    title = "Glint / Embree's best watertight mode, one thread"
    size = f'width="{right + 240}" height="{max(height + 60, 40 + 16 * len(names))}"'
    style = 'font-family="sans-serif" font-size="12"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style}><text x="60" '
        f'y="14">{title}</text>{"".join(parts)}</svg>\n'
    )
