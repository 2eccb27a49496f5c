"""The report of a calibration."""

from collections.abc import Callable, Iterable

import numpy as np

from ...base.display import Fact
from ...base.text import counted, quantity
from ...figures.drawing import Drawing
from ...figures.report import Part, Report, Section, Table
from ...models.parsing import to_yaml
from .balance import hangs
from .clock import is_still
from .clock_rate import CLEAR
from .considered import usual_error
from .file_errors import ENDS
from .geometry import length_of
from .hanging import carrying
from .left_out import SLACK, hardly_pull, left_out
from .parameters import GROUPS, IN_BALANCE, Parameter
from .result import CalibrationData, apart
from .solving import considered_of
from .turning import turning

MOST_LISTED = 12
MOST_NAMED = 4
LACKS = 3.0  # times the stated standard deviation, of residuals that noise alone does not cause
LOOSE = 0.1  # [m] of standard deviation, which files of robots are usually better than
UNKNOWN = " (it lacks the stretch of cables, for example, as no tensions were measured)"
SMALLEST = 1e-6  # [m]: a smaller residual or change of a length means nothing


def report(result: CalibrationData, drawings: Callable[[], Iterable[Drawing]] = tuple) -> Report:
    """Return the residuals, the parameters and the unobservable directions."""
    residual = f"{_mm(result.residual_before)} before, {_mm(result.residual_after)} after (rms)"
    about, _, summary = headline(result).partition(": ")
    status, warning = ("file confirmed", "") if result.confirms_file else ("not usable", "DO NOT USE THIS RESULT: ")
    parts: list[Part] = [
        f"residual of the lengths {residual}",
        *([] if result.refused is None else [f"{warning}{result.refused}"]),
        *([f"CHECK THE LOG: {result.mistake.text}"] if result.mistake and not result.mistake.severe else []),
        *(_of_held_out(result) if result.means_something else []),
        *(_of_noise(result) if result.doubt is None else []),
        *(_of_parameters(result) if result.free and result.means_something else []),
        *([*_of_exceptions(result), *_of_open(result)] if result.free and result.doubt is None else []),
    ]
    return Report(
        about,
        "" if result.refused is None else status,
        summary,
        parts,
        drawings,
        files=[("The robot's file", lambda: to_yaml(result.robot))],
    )


def headline(result: CalibrationData) -> str:
    """Return in one line what was calibrated, from how many samples, and whether the result can be used."""
    free = ", ".join(result.free) or "the file as it is, checked"
    state = "" if result.converged else ", NOT CONVERGED"
    source = "from" if result.free else "with"
    part = "" if result.samples is None else " of a longer log"
    return f"{result.file.name}: {free} {source} {len(result.residuals)} samples{part}{state}"


def facts(result: CalibrationData) -> list[Fact]:
    """Return the facts that need no further calibration, with the parameters that changed most."""
    residual = f"{_mm(result.residual_before)} before, {_mm(result.residual_after)} after (rms)"
    doubt = [] if result.doubt is None else [("DO NOT USE", result.doubt)]
    by_size = sorted(result.parameters, key=lambda one: -abs(one.correction))
    shown = map(_one, by_size[:MOST_LISTED])
    counts = (("wrong readings", result.outliers), ("slips", result.slips), ("unobservable", result.not_identifiable))
    return [
        *doubt,
        ("residual of the lengths", residual),
        *((name, quantity(len(of))) for name, of in counts if of),
        ("parameters", quantity(len(by_size))),
        *((name, f"{value} +- {sigma} change {change}") for name, value, sigma, change in shown),
    ]


def _mm(length: float) -> str:
    if abs(length) < SMALLEST:
        return f"under {quantity(1e3 * SMALLEST, 'mm')}"
    return quantity(1e3 * length, "mm", digits=3)


def _of_held_out(result: CalibrationData) -> list[str]:
    held_out = result.held_out
    if not np.isfinite(held_out.after):
        return ["no cross-validation: half of the samples are too few, or their fit did not converge"]
    lines = [f"residual on validation samples {_mm(held_out.before)} before, {_mm(held_out.after)} after (rms)"]
    fitted = held_out.sets[-1].fitted
    if not held_out.best:
        equal = result.free and held_out.after <= held_out.before
        return [*lines, "the file predicts validation samples equally well"] if equal else lines
    if set(held_out.best) < set(result.free):
        lines.append(
            f"validation samples are predicted equally well with only {', '.join(held_out.best)}: the other "
            "parameters do not help"
        )
    if held_out.after > 1.5 * fitted:
        lines.append(
            f"validation samples have larger residuals ({_mm(held_out.after)}) than training samples ({_mm(fitted)}): "
            "so many parameters require more samples"
        )
    return lines


def _of_noise(result: CalibrationData) -> list[str]:
    stated = result.stated_sigma
    lines = []
    if np.isfinite(result.noise) and result.noise > 1.05 * stated:
        lines.append(
            f"lengths scatter by {_mm(result.noise)}, not by the {_mm(stated)} assumed: the standard deviations "
            f"below are multiplied by {quantity(result.noise / stated, digits=3)}"
        )
    if result.noise > LACKS * stated and "scales" not in result.free:
        lines.append("the model is incomplete: --free auto also tries scales, attachments and more")
    stretch = next((one for one in result.parameters if one.name == "compliance"), None)
    if stretch is not None and 0 < stretch.sigma < stretch.value:
        share = quantity(100 * stretch.sigma / stretch.value, digits=2)
        by_weight = " and the platform has the file's mass" if result.measurements.tensions is None else ""
        if "stiffness" in result.free or any(cable.stiffness for cable in result.file.cables):
            more = quantity(1e6 * stretch.value, "1/MN", 3)
            lines.append(
                f"cables stretch more than by their own stiffness: 1 / (E A) is {more} more, +- {share} %, "
                f"if it is as much more for all cables{by_weight}"
            )
        else:
            size = quantity(1e-3 / stretch.value, "kN", 3)
            lines.append(f"cables stretch: E A is {size}, +- {share} %, if it is the same for all cables{by_weight}")
    forces = result._solved.model.forces
    timeless = hangs(result.file, result.measurements) and result.measurements.times is None
    if timeless and forces is not None and not forces.motion_is_known:
        lines.append("the poses look like a motion without times, so stretch of the cables was not sought")
    for frame, end in ENDS.items():
        size = f"wrong by {_mm(result.prior[end])}" if end in result.prior else "exact"
        what = "the frame of the poses" if frame == "frame" else "the measured body"
        if frame == "body" and frame in result.free and result._solved.model.size_is_open:
            found = "the sensor of orientations may be mounted askew (body.turn is the correction)"
        elif frame in result.free:
            found = f"{what} was found from the file's {end}, which are assumed to be {size}"
        elif end in result.prior:
            found = f"where the log hardly tells how {end} differ from the file's, these are assumed to be {size}"
        else:
            continue
        lines.append(f"{found}: the standard deviations below include this error")
    kept = [name for name in ("anchors", "offsets") if name not in result.free]
    still, uncertainty = len(kept) == 1 and is_still(result.measurements), result.file.uncertainty
    known = "frame" in result.free or (uncertainty and any(".anchor." in name for name in uncertainty.parameters))
    if still or (kept[:1] == ["anchors"] and not set(result.free) <= {*IN_BALANCE} and not known):
        why = "the lengths hardly change, so they do not distinguish offsets from anchors: " * still
        free = ",".join(name for name in GROUPS if name in (kept[0], *result.free))
        held = f"hold only if the file's {kept[0]} are exact"
        if kept[0] == "anchors" and result.measurements.carrier_poses is None:
            error = considered_of(result._solved).error
            how = "assumed" if error <= usual_error(result._solved.model) else "as residuals show"
            size = "" if known else f" of {_mm(error)} ({how})"
            held = f"include errors{size} of the file's anchors"
        lines.append(
            f"{why}the standard deviations below {held}; with --free {free} --prior {kept[0]}=0.02 they include errors "
            "of 20 mm"
        )
    if result.growth is not None:
        free = ",".join(name for name in GROUPS if name in ("scales", *result.free))
        lines.append(
            f"the anchors are {apart(result.growth)} than in the file, which lengths without positions do not "
            "distinguish from a scale of all readings: the standard deviations below hold only if the file's scales "
            f"are exact; with --free {free} --prior anchors=0.02,scales=0.02 they include errors of both"
        )
    turns = turning(result.file, result.measurements) if "attachments" in result.free else None
    if turns is not None and not turns.enough:
        by = quantity(np.degrees(turns.angle), "deg", 2)
        lines.append(
            f"the platform turns by {by}, which moves its attachments by {_mm(turns.shift)}: errors of the model may "
            "look like displaced attachments; turn it farther, or leave them out of --free"
        )
    if (again := result.repeating) is not None:
        what, cause = (
            ("lengths of the cables", "layers on their drums") if again.of_lengths else ("pose", "pulleys or stretch")
        )
        lines.append(
            f"errors of {_mm(again.sigma * result.residual_after)} repeat with the {what}, as of {cause} that the "
            "model lacks, and more samples do not average them: the standard deviations below include them"
        )
    if (missing := result.missing_pulleys) is not None:
        (axis, radius), *others = missing.radii.items()
        also = "".join(f", or of {_mm(size)} with axes {way}" for way, size in others)
        lines.append(
            f"the cables seem to run over pulleys with a radius of about {_mm(radius)} and swivel axes {axis}{also}, "
            "which the file lacks: give its cables the key pulley, because anchors without pulleys are displaced; the "
            "standard deviations below include this error"
        )
    if result.autocorrelation > 1:
        tense = result.measurements.tensions is not None or hangs(result.file, result.measurements)
        lasting = f"perhaps because the model is incomplete{'' if tense else UNKNOWN}"
        cause = lasting if result._noise.lasting else "because the poses are smoothed"
        lines.append(
            f"residuals are autocorrelated, {cause}: "
            f"the standard deviations below are multiplied by {quantity(result.autocorrelation**0.5, digits=2)}"
        )
    return lines


def _of_parameters(result: CalibrationData) -> list[Part]:
    lines: list[Part] = []
    length = length_of(result.file)  # on which a scale acts
    by_size = sorted(result.parameters, key=lambda one: -abs(one.correction) * (length if one.unit == "1" else 1))
    rate = result.clock_rate
    clear = rate is not None and abs(rate.value) > CLEAR * rate.sigma
    clocks = (*([rate] if rate and clear else []), *result.carrier_clocks)
    always = [one.name for one in (*result.parameters, *clocks) if "[" not in one.name]  # of the robot
    shown = {one.name for one in by_size[:MOST_LISTED]} | set(always)
    rows = [_one(one) for one in (*result.parameters, *clocks) if one.name in shown]
    columns = ("parameter", "value", "standard deviation", "change from the file")
    lines.append(Table("Parameters", columns, rows, (1, 2, 3)))
    if more := sum(one.name not in shown for one in result.parameters):
        lines.append(f"and {more} more, with no larger changes")
    if result.beyond_prior:
        named = _first([f"{name} ({quantity(sigmas, digits=2)})" for name, sigmas in result.beyond_prior], MOST_LISTED)
        lines.append(f"beyond 5 sigmas of the prior: {named}; check the log, the file and the prior")
    return lines


def _one(one: Parameter) -> tuple[str, str, str, str]:
    """Return name, value, standard deviation and change of a parameter."""
    usual = {
        "m": (1e3, "mm"),
        "s": (1e3, "ms"),
        "1": (1e6, "ppm"),
        "1/N": (1e6, "1/MN"),
        "1/m": (1e6, "ppm/m"),
        "rad": (180 / np.pi, "deg"),
    }
    factor, unit = usual.get(one.unit, (1.0, one.unit))
    sigma = quantity(factor * one.sigma, unit, digits=2) if np.isfinite(one.sigma) else "not determined"
    change = quantity(0.0 if unit == "mm" and abs(one.correction) < SMALLEST else factor * one.correction, unit)
    decimals = round(one.value, 6) + 0.0  # zero without a sign
    value = f"{one.value:.6g} {one.unit}" if "/" in one.unit else f"{decimals:.6f} {one.unit}".removesuffix(" 1")
    return one.name, value, sigma, change


def _of_exceptions(result: CalibrationData) -> list[str]:
    model = result._solved.model
    lines = [
        f"cables[{slip.cable}] slipped on its winch: {result._since(first)} it is {_mm(abs(slip.size))} "
        f"{'longer' if slip.size > 0 else 'shorter'} than its reading (+- {_mm(slip.sigma)})"
        for slip, (_, first) in zip(result.slips, model.parameters.slips, strict=True)
    ]
    felt = carrying(model, result._solved.fit.state)
    loose = hardly_pull(felt.tensions) if felt else np.zeros_like(model.weights.T)
    for why, which in left_out(model.robot, model.measurements).items():
        count = ((which | loose * (why == SLACK)) & ~model.weights.T).sum(axis=0)
        if count.any():
            named = ", ".join(f"cables[{i}] ({count[i]})" for i in np.flatnonzero(count))
            lines.append(f"left out: readings of {why}: {named}")
    wrong = sorted(result.outliers, key=lambda one: -abs(one.error))
    whole = len({one.sample for one in wrong if one.others})
    if whole and result._noise.redundancy < len(result.parameters):
        lines.append(
            f"CANNOT TELL which readings are wrong: {whole} of {len(result.residuals)} samples are left out whole, and "
            "the others hardly check each other: errors may be larger than stated, so add samples"
        )
    lines += [
        f"left out: {', '.join(f'cables[{i}]' for i in (one.cable, *one.others))} at sample {one.sample}, "
        f"{f'because one of them is wrong; cables[{one.cable}] would be ' * bool(one.others)}off by {_mm(one.error)}"
        for one in wrong[:MOST_LISTED]
    ]
    if len(wrong) > MOST_LISTED:
        lines.append(f"and {counted(len(wrong) - MOST_LISTED, 'more reading')} left out")
    return lines


def _first(names: list[str], most: int) -> str:
    """Return the first names in one text, and how many more there are."""
    return ", ".join(names[:most]) + f" and {len(names) - most} more" * (len(names) > most)


def _of_open(result: CalibrationData) -> list[Part]:
    texts, lines = result.not_identifiable, list[Part]()
    loose = [one.name for one in result.parameters if one.unit == "m" and LOOSE < one.sigma < np.inf]
    if loose:
        lines.append(f"poorly determined: {_first(loose, MOST_NAMED)}; measure other poses, or give a prior")
    if not texts:
        return [*lines, "all directions of the parameters are observable"]
    kept = "only the file tells the values" if result.unobserved else "the file's values are kept"
    title = f"{counted(len(texts), 'unobservable direction')}, along which {kept}:"
    return [*lines, Section(title, [("", text) for text in texts])]
