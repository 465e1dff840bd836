"""`somersault score`: recorded motions scored, with the cross-validation error of the scores."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from somersault.cli import tables
from somersault.cli.documents import Document, read
from somersault.errors import InputError

#: Of the table of scores. The distance is to the training motions; beyond 1 a motion is not like them.
_COLUMNS = ("file", "score", "predicted", "distance")
#: Distance of a judged motion to the others that is worth a word.
_FAR = 2.0


def score(arguments: argparse.Namespace) -> int:
    """Learns or loads a scorer, scores, and writes a table and the validation summary."""
    # Imported here, since it needs a good part of SciPy.
    motion: Any = importlib.import_module("somersault.motion")
    document = read(arguments.file, "score")
    tables.check(arguments.out, arguments.format)
    for path in (arguments.save, arguments.summary):
        tables.check(path, "csv")
    tables.check_distinct(arguments.file, out=arguments.out, save=arguments.save, summary=arguments.summary)
    judged = document.values.get("judged", [])
    summary: dict[str, Any] = {}
    rows: list[tuple[str, float, float, float]] = []
    _expect_once(document, judged)
    if judged:
        seen = [
            _performance(motion, document, ("judged", i, "file"), item["file"])
            for i, item in enumerate(judged)
        ]
        scores = [item["score"] for item in judged]
        athletes = _athletes(document, judged)
        with document.at("options"):
            options = _options(motion, document.values.get("options", {}))
        with document.at("judged"):
            worth = motion.validate(seen, scores, options, groups=athletes)
            scorer = motion.ScoringModel(seen, scores, options, groups=athletes)
        summary = _summary(worth)
        rows += [
            (item["file"], item["score"], float(predicted), float(distance))
            for item, predicted, distance in zip(judged, worth.predictions, worth.distances, strict=True)
        ]
    else:
        with document.at("scorer"):
            scorer = motion.ScoringModel.load(document.path.parent / document.values["scorer"])
    for i, file in enumerate(document.values.get("motions", [])):
        performance = _performance(motion, document, ("motions", i), file)
        with document.at("motions", i):
            found = scorer.score(performance)
        rows.append((file, float("nan"), found.value, found.distance))
    columns = {
        name: np.array([row[i] for row in rows], dtype=object if name == "file" else float)
        for i, name in enumerate(_COLUMNS)
    }
    summary |= _taught(scorer)
    tables.write(columns, arguments.out, arguments.format)
    if arguments.save:
        scorer.save(arguments.save)
    if arguments.summary:
        arguments.summary.write_text(json.dumps(summary, indent=2) + "\n", "utf-8")
    return _said_outside(rows, len(judged))


def _said_outside(rows: list[tuple[str, float, float, float]], n_judged: int) -> int:
    """Names the motions that are not like the training motions; their scores are no success."""
    # one of the judged is always the farthest from the others, beyond 1
    for file, _, _, distance in rows[:n_judged]:
        if distance > _FAR:
            print(
                f"somersault: {file} is {distance:.1f} times as far from the other judged motions as these"
                " are from each other: are its unit, axes and names right?",
                file=sys.stderr,
            )
    outside = [(file, distance) for file, _, _, distance in rows[n_judged:] if not distance <= 1.0]
    for file, distance in outside:
        print(
            f"somersault: {file} is {distance:.1f} times as far from the training motions as these are from"
            " each other: its score says nothing",
            file=sys.stderr,
        )
    return 1 if outside else 0


def _options(motion: Any, given: dict[str, Any]) -> Any:
    """A pair is a list in documents."""
    scale = {"scale": tuple(given["scale"])} if "scale" in given else {}
    return motion.ScoringOptions(**(given | scale))


def _athletes(document: Document, judged: list[dict[str, Any]]) -> list[str] | None:
    """The athlete of each motion, where all have one."""
    athletes = [item.get("athlete") for item in judged]
    named = [athlete for athlete in athletes if athlete is not None]
    if named and len(named) < len(athletes):
        raise document.fault(
            ("judged", athletes.index(None)), "must have an `athlete`, as others have; give all or none"
        )
    return named or None


def _expect_once(document: Document, judged: list[dict[str, Any]]) -> None:
    """A motion that is left out must not be learnt from under another name."""
    seen: dict[Path, int] = {}
    for i, item in enumerate(judged):
        path = (document.path.parent / item["file"]).resolve()
        if path in seen:
            raise document.fault(
                ("judged", i, "file"), f"is the file of entry {seen[path]} too; each must be given once"
            )
        seen[path] = i


def _taught(scorer: Any) -> dict[str, Any]:
    """What the scores were learnt from."""
    return {
        "learnt": {
            "n_motions": len(scorer.scores),
            "scores": [float(scorer.scores.min()), float(scorer.scores.max())],
            "scale": list(scorer.scale),
            "kind": scorer.kind,
            "names": list(scorer.names),
            "unit": "m",
            "up": "z",
            "heading": "turned about z to the nearest to the mean of the training motions",
            "synthetic": scorer.synthetic,
        }
    }


def _performance(motion: Any, document: Document, where: tuple[str | int, ...], file: str) -> Any:
    reading = dict(document.values.get("read", {}))
    longest = reading.pop("longest_gap", None)
    with document.at(*where):
        recording = motion.read_file(document.path.parent / file, **reading)
        if isinstance(recording, motion.SkeletonRecording):
            recording = recording.joint_centres()
        if not isinstance(recording, motion.MarkerRecording):
            needed = "a recording of markers or of a skeleton is needed"
            raise InputError(f"{file}: {needed}, found {recording!r}")
        if longest is not None:
            recording = recording.fill_gaps(longest)
        return motion.Performance.from_markers(recording)


def _summary(worth: Any) -> dict[str, Any]:
    return {
        "rms_error": worth.rms_error,
        "r_squared": worth.r_squared,
        "n_components": worth.n_components,
        "penalties": worth.penalties.tolist(),
        **{
            name: {"value": found.value, "interval": list(found.interval)}
            for name, found in (("pearson", worth.pearson), ("spearman", worth.spearman))
        },
        "baselines": {baseline.name: baseline.rms_error for baseline in worth.baselines},
    }


def add(commands: Any) -> None:
    """Adds the command to the parser."""
    parser = commands.add_parser(
        "score",
        help="score the recorded motions that a file names",
        description="Learns a scoring model from judged motions, reports its cross-validation error, and"
        " scores other motions. Ends with 1 where a motion is not like the training motions.",
    )
    parser.add_argument(
        "file", type=Path, help="read this input, TOML or JSON; see `somersault schema score`"
    )
    parser.add_argument(
        "--out", type=Path, help="write the scores here, .parquet, .csv or .json (default: print CSV)"
    )
    parser.add_argument("--format", choices=tables.FORMATS, help="write the scores in this format")
    parser.add_argument(
        "--summary", type=Path, metavar="FILE", help="write the validation summary here, JSON"
    )
    parser.add_argument(
        "--save",
        type=Path,
        metavar="FILE",
        help="write the scoring model here, for `scorer` of another input",
    )
    parser.set_defaults(command=score)
