"""Command line: `python -m analysis VERB …`. Files in, files out; exit 0 only if every claim held, 2 for bad input."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from fmu_src.quantities import ParameterError

from .certificates.verbs import add_verbs
from .errors import CosimError, InputError
from .scenario import built_in_scenarios, names_a_folder, read_scenario
from .trajectory import CERTIFICATE, FINDINGS, RECORD, Run, new_run_folder, read_record, read_run, write_run


def main(arguments: list[str] | None = None) -> int:
    """Run one verb; returns the exit status."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # unwinds, so that folders are removed
    options = _parser().parse_args(arguments)
    try:
        return int(options.do(options))
    except (InputError, CosimError, ParameterError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except MemoryError as error:
        print(
            f"error: not enough memory: {error or 'none left'}; wanted a longer step or a shorter time", file=sys.stderr
        )
        return 2
    except KeyboardInterrupt:
        print("interrupted; nothing was written", file=sys.stderr)
        return 128 + signal.SIGINT


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m analysis", description=__doc__)
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    scenario = f"a .toml file, the run.json of an earlier run, or one of: {', '.join(built_in_scenarios())}"

    verb = verbs.add_parser("run", help="simulate a scenario and those beside it, check, and write the report")
    verb.add_argument("scenario", help=scenario)
    verb.add_argument("-o", "--out", type=Path, help="run folder (default: runs/SCENARIO)")
    verb.set_defaults(do=_run)

    verb = verbs.add_parser("simulate", help="co-simulate a scenario and write its run folder")
    verb.add_argument("scenario", help=scenario)
    verb.add_argument("-o", "--out", type=Path, required=True, metavar="RUN", help="run folder to write")
    verb.set_defaults(do=_simulate)

    verb = verbs.add_parser("check", help="check the claims on a run and write its findings.json")
    what = "run folder, or FILE.csv that another tool wrote (its findings go to FILE.findings.json)"
    verb.add_argument("run", type=Path, metavar="RUN", help=what)
    classes = (
        "for a .csv: 'exact', the scenario's profile is the road; or, with its heights as columns, 'curv:H2' "
        "(|h''| <= H2 [m/s^2] between rows) or 'lip:H1' (|h'| <= H1 [m/s])"
    )
    verb.add_argument("--road-class", metavar="CLASS", help=classes)
    verb.add_argument(
        "--parameters", metavar="SCENARIO", help=f"for a .csv: its car and road: {scenario} (default: bump)"
    )
    verb.set_defaults(do=_check)

    verb = verbs.add_parser("report", help="draw the figures of a run and write its report.html")
    verb.add_argument("run", type=Path, metavar="RUN", help="run folder")
    verb.set_defaults(do=_report)

    verb = verbs.add_parser("ride", help="how runs ride: settling, ISO 2631, tyre loads, energy, side by side")
    verb.add_argument("runs", type=Path, metavar="RUN", nargs="+", help="run folders")
    verb.set_defaults(do=_ride)

    verb = verbs.add_parser("audit", help="audit the equations and claims of the paper; needs no run")
    verb.add_argument("-o", "--out", type=Path, metavar="DIR", help="also write audit.md, audit.json and figures there")
    verb.set_defaults(do=_audit)

    verb = verbs.add_parser("modes", help="modes of a scenario's car, and the tensors of its quasi-linear equations")
    verb.add_argument("scenario", nargs="?", help=f"{scenario} (default: the default car)")
    verb.add_argument("-o", "--out", type=Path, metavar="DIR", help="folder for modes.json, modes.svg, quasilinear.md")
    verb.set_defaults(do=_modes)

    add_verbs(verbs, scenario)

    verb = verbs.add_parser(
        "resonances", help="how near the car's modes and road are to resonance, and what detunes them"
    )
    verb.add_argument("scenario", nargs="?", default="sine", help=f"{scenario} (default: sine)")
    verb.add_argument("--scan", metavar="PARAMETER", help="vary speed, c2/c1, Jy or b/a from half to twice its value")
    verb.add_argument("-o", "--out", type=Path, metavar="DIR", help="folder for the table and the map of the scan")
    verb.set_defaults(do=_resonances)

    verb = verbs.add_parser(
        "spatial", help="how much energy the nonlinear terms move between the car's modes, and where"
    )
    energies = "or a run folder: energy of each mode along the run and its series"
    verb.add_argument("scenario", nargs="?", default="fourier-fl", help=f"{scenario} (default: fourier-fl); {energies}")
    verb.add_argument("-o", "--out", type=Path, metavar="DIR", help="folder for the table (default for a run: the run)")
    verb.set_defaults(do=_spatial)

    verb = verbs.add_parser(
        "stabilize", help="optimal stabilization of section 4 and its robustness, of the default car; needs no run"
    )
    verb.add_argument(
        "-o", "--out", type=Path, metavar="DIR", help="also write stabilization.md, .json and figures there"
    )
    verb.set_defaults(do=_stabilize)
    return parser


def _spatial(options: argparse.Namespace) -> int:
    _wants_folder(options.out)
    if names_a_folder(options.scenario):
        from .run_energies import command as along

        return along(Path(options.scenario), options.out)
    from .scans.spatial_scan import command

    return command(options.scenario, options.out)


def _resonances(options: argparse.Namespace) -> int:
    from .scans.resonance_scan import command

    return command(options.scenario, options.scan, options.out)


def _simulate(options: argparse.Namespace) -> int:
    from .cosimulation import simulate

    scenario = read_scenario(options.scenario)
    with new_run_folder(options.out) as folder:
        run = simulate(scenario, progress=True)
        _compare_fmus(options.scenario, run)
        write_run(run, folder)
    print(f"{options.out}: written")
    return 0


def _run(options: argparse.Namespace) -> int:
    from .beside import simulate_beside
    from .check import lacking
    from .cosimulation import simulate
    from .report import write_report

    scenario = read_scenario(options.scenario)
    target = options.out or Path("runs") / scenario.name
    with new_run_folder(target) as folder:
        if target.exists():
            print(f"{target}: an older run is there and will be replaced", file=sys.stderr)
        run = simulate(scenario, progress=True)
        _compare_fmus(options.scenario, run)
        write_run(run, folder)
        simulate_beside(scenario, run, folder)
        _certify_shortly(run, folder)
        verdict = 0
        if missing := lacking(run):
            print(f"nothing is checked: {', '.join(missing)} are not among `record`", file=sys.stderr)
        else:
            verdict = _judge(run, folder)
        print("Drawing the figures ...", file=sys.stderr, flush=True)
        write_report(folder)
    print(f"{target / 'report.html'}: written")
    return verdict


def _certify_shortly(run: Run, folder: Path) -> None:
    """Prove almost stability for the report, where it applies and takes seconds; else say why not."""
    from .certificates.certified_run import certify_run, road_ends

    wait = "the road has no end, so that it takes longer: certify RUN"
    if reason := certify_run(run, folder) if road_ends(run) else wait:
        print(f"no certificate of almost stability: {reason}", file=sys.stderr)


def _ride(options: argparse.Namespace) -> int:
    from .ride import notes, ride, table

    runs = [read_run(folder) for folder in options.runs]
    rows = table([ride(run) for run in runs])
    print("| | unit |", " | ".join(_headings(options.runs)), "|")
    print("|---|---|" + "---:|" * len(options.runs))
    for words, unit, values in rows:
        print(f"| {words} | {unit} |", " | ".join(f"{v:.3g}" if v == v else "not in this run" for v in values), "|")
    print("".join(f"\n{note}\n" for note in notes(runs)), end="")
    return 0


def _headings(runs: list[Path]) -> list[str]:
    """The folders' names, with those of a run that they lie in: `counterpart` alone says nothing."""
    places = [folder.resolve() for folder in runs]
    return [f"{p.parent.name}/{p.name}" if (p.parent / RECORD).is_file() else p.name for p in places]


def _compare_fmus(scenario: str, run: Run) -> None:
    """Say so if a run that is repeated from its record was made by other FMUs."""
    if scenario.endswith(".json"):
        before, now = read_record(Path(scenario))["fmus"], run.record["fmus"]
        if others := [name for name in now if before.get(name, {}).get("sha256") != now[name]["sha256"]]:
            print(f"not the FMUs of {scenario}: {', '.join(others)}; results may differ", file=sys.stderr)


def _check(options: argparse.Namespace) -> int:
    if options.run.suffix == ".csv":
        from .certificates.run_certificates import judge_export

        return judge_export(options.run, options.road_class, options.parameters)
    if options.road_class or options.parameters:
        raise InputError(f"{options.run}: a run folder says its own road and car; wanted no options, or a .csv file")
    return _judge(read_run(options.run), options.run)


def _judge(run: Run, folder: Path) -> int:
    """Check, write findings.json, print a line for each; 0 if all hold, 1 if not."""
    from .certificates.certified_run import definition_findings
    from .certificates.run_certificates import certified_findings
    from .check import check, too_short
    from .findings import Finding, write_findings
    from .run_averaging import averaged_findings
    from .run_series import series_findings
    from .tyres import lift_off

    findings = check(run)
    if short := too_short(run):
        print(f"check: {short}", file=sys.stderr)
    others: dict[str, Callable[[Run], tuple[list[Finding], str]]] = {
        "averaging": averaged_findings,
        "series": series_findings,
        "proof": certified_findings,
    }
    if (path := folder / CERTIFICATE).is_file():
        others["certificate"] = partial(definition_findings, path=path)
    for name, judged in others.items():
        found, why_not = judged(run)
        findings += found
        if why_not:
            print(f"{name}: not compared with the run, or not all: {why_not}", file=sys.stderr)
    write_findings(findings, folder / FINDINGS)
    for f in findings:
        print(f.line)
    if words := lift_off(run):
        print(f"contact: the model's tyres pulled where real ones leave the ground: {words}", file=sys.stderr)
    return 0 if all(f.holds for f in findings) else 1


def _report(options: argparse.Namespace) -> int:
    from .report import write_report

    print(f"{write_report(options.run)}: written")
    return 0


def _audit(options: argparse.Namespace) -> int:
    from .audit.document import audit, text, write

    _wants_folder(options.out)
    result = audit(progress=True)
    print(text(result))
    if options.out:
        for path in write(result, options.out):
            print(f"{path}: written")
    return 0 if result.holds else 1


def _wants_folder(out: Path | None) -> None:
    """Refuse a file before anything is computed for it."""
    if out and out.exists() and not out.is_dir():
        raise InputError(f"{out}: wanted a folder, got a file; name another with -o")


def _modes(options: argparse.Namespace) -> int:
    from .mode_report import run
    from .reference import car_of

    _wants_folder(options.out)
    if options.scenario is None:
        return run(car_of({}), "the default car", "python -m analysis modes -o DIR", options.out)
    scenario = read_scenario(options.scenario)
    command = f"python -m analysis modes {options.scenario} -o DIR"
    return run(car_of(scenario.parameters), f"the car of {scenario.name}", command, options.out)


def _stabilize(options: argparse.Namespace) -> int:
    from .stabilization.document import run

    return run(options.out)


if __name__ == "__main__":
    sys.exit(main())
