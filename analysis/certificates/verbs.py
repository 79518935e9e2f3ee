"""Verbs of the command line on certificates: certify, verify, conditions."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..scenario import names_a_folder, read_scenario
from ..trajectory import CERTIFICATE, RECORD, read_run


def add_verbs(verbs: Any, scenario: str) -> None:
    """Add them to the subparsers `verbs`; `scenario` says in words what names one."""
    verb = verbs.add_parser("certify", help="prove that x_lin is almost stable (definition 2.1) on a scenario's road")
    verb.add_argument("scenario", help=f"{scenario}; or a run folder, which then gets its certificate and figures")
    verb.add_argument(
        "-o",
        "--out",
        type=Path,
        metavar="CERT.json",
        help="certificate to write; CERT.svg: its figure, but with --bounded",
    )
    kind = verb.add_mutually_exclusive_group()
    kind.add_argument("--quick", action="store_true", help="a coarse floor in about a second, by comparison")
    kind.add_argument("--largest", action="store_true", help="also search the largest amplitude that can be certified")
    kind.add_argument("--bounded", type=float, metavar="A", help="every road with |h| <= A [m] instead, around rest")
    sampled = "every road through the heights of this CSV instead (time, h_fl ... h_rr) that is of --road-class"
    kind.add_argument("--sampled", type=Path, metavar="ROAD.csv", help=sampled)
    verb.add_argument(
        "--road-class", metavar="CLASS", help="between rows: curv:H2 (|h''| <= H2) or lip:H1 (|h'| <= H1)"
    )
    verb.add_argument("--slope", type=float, metavar="V", help="with --bounded: roads with |dh/dt| <= V [m/s] too")
    closed = (
        "under control for ever, and by time on its horizon (CERT.horizon.json), against no control; with --sampled"
    )
    verb.add_argument("--closed-loop", action="store_true", help=f"{closed}: for ever")
    verb.add_argument(
        "--fmu-starts", type=int, default=0, metavar="N", help="also try N starts within delta on the FMUs"
    )
    verb.set_defaults(do=_certify)

    verb = verbs.add_parser("verify", help="prove a certificate's claims anew")
    verb.add_argument("certificate", type=Path, metavar="CERT", help="certificate (JSON)")
    verb.set_defaults(do=_verify)

    verb = verbs.add_parser("conditions", help="conditions 1 and 2 after (2.11), and the forms of them that can hold")
    verb.add_argument("scenario", nargs="?", default="sine", help=f"{scenario} (default: sine)")
    verb.set_defaults(do=_conditions)


def _certify(options: argparse.Namespace) -> int:
    if names_a_folder(options.scenario):
        return _certify_run(Path(options.scenario), options)
    if options.out and options.out.suffix == ".svg":
        raise InputError(f"-o {options.out}: wanted a name for the certificate, CERT.json; its figure is CERT.svg")
    if options.out and options.out.is_dir():
        raise InputError(f"-o {options.out}: wanted a name for the certificate, CERT.json, got a folder")
    if options.out and not options.out.parent.is_dir():
        raise InputError(f"-o {options.out}: there is no folder {options.out.parent}; make it first")
    scenario = read_scenario(options.scenario)
    if options.out and options.quick:
        raise InputError(f"-o {options.out}: --quick writes no certificate; leave it out")
    if any(scenario.start.values()) and options.bounded is None:
        print("[start] is left out: x_lin is that from rest; certify RUN takes a run's own start.", file=sys.stderr)
    if options.slope is not None and options.bounded is None:
        raise InputError(f"--slope {options.slope!r}: wanted --bounded with it")
    if (options.sampled is None) is not (options.road_class is None):
        raise InputError("wanted both --sampled and --road-class, or neither: rows say nothing of the road between")
    _refuse_mixed(options)
    if options.sampled is not None:
        from .car_sampled_roads import command as through_rows

        return through_rows(scenario.parameters, options.sampled, options.road_class, options.out, options.closed_loop)
    if options.bounded is not None:
        from .car_bounded_roads import command

        return command(scenario.parameters, options.bounded, options.slope, options.out)
    if options.closed_loop:
        from .closed_loop_certificate import command as compare

        return compare(scenario.parameters, options.out)
    if options.quick:
        from .quick_command import quick_answer

        return quick_answer(scenario.parameters)
    from .certificate_command import make_certificate

    return make_certificate(scenario, options.out, search=options.largest, starts=options.fmu_starts)


def _refuse_mixed(options: argparse.Namespace) -> None:
    """Raise InputError for options that do not go together."""
    others = options.quick or options.bounded is not None
    if options.closed_loop and (others or options.largest):
        raise InputError("--closed-loop: wanted alone or with --sampled")
    if options.fmu_starts and (others or options.closed_loop or options.sampled is not None):
        raise InputError(
            f"--fmu-starts {options.fmu_starts}: wanted with a certificate of the scenario's own road only"
        )
    if options.fmu_starts < 0:
        raise InputError(f"--fmu-starts {options.fmu_starts}: wanted a number of starts")


def _certify_run(folder: Path, options: argparse.Namespace) -> int:
    from .certified_run import certify_run

    others = options.bounded, options.sampled, options.road_class
    switches = options.quick, options.largest, options.closed_loop, options.fmu_starts, options.out
    if any(switches) or any(o is not None for o in others):
        raise InputError(f"{folder}: a run folder is certified without options; for them give {folder / RECORD}")
    if reason := certify_run(read_run(folder), folder):
        print(f"no certificate: {reason}")
        return 1
    print(f"{folder / CERTIFICATE}: written; python -m analysis check {folder} judges the run by it, report shows it")
    return 0


def _verify(options: argparse.Namespace) -> int:
    from .certificate_command import judge_certificate

    return judge_certificate(options.certificate)


def _conditions(options: argparse.Namespace) -> int:
    from .car_conditions import command

    return command(read_scenario(options.scenario).parameters)
