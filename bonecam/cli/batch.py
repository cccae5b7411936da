"""The command `batch`: its arguments, and what it does."""

import argparse
from contextlib import nullcontext
from typing import Any

import bonecam
from bonecam.cli.parser import add_job_options, job_of, share_of


def add_batch(add_command: Any, parsers: Any) -> None:
    """The command `batch`."""
    text = "Make the NC programs of several parts, each in a process of its own."
    batch = add_command(parsers, "batch", text, run_batch)
    kept = "finished programs are kept, --resume continues from there"
    batch.set_defaults(stopped=kept, stopped_late=kept)
    parts = "parts as for `convert`, folders of parts, or a table of parts (parts.csv: file, job, units, stock, output)"
    batch.add_argument("parts", metavar="PART", nargs="+", help=parts)
    folder = "folder for programs, reports and batch.csv"
    batch.add_argument("-o", "--output", metavar="DIR", required=True, help=folder)
    batch.add_argument("--jobs", metavar="N", type=int, default=2, help="number of parts at a time (2)")
    resume = "skip parts that an earlier run finished with the same mesh, job, files of the job, and package"
    batch.add_argument("--resume", action="store_true", help=resume)
    batch.add_argument("--html", action="store_true", help="write a page of each part, NAME.html")
    batch.add_argument("--sheet", action="store_true", help="write a setup sheet of each part, NAME.sheet.html")
    keep = "write a folder of each part, NAME: surface, levels, tool path and pictures"
    batch.add_argument("--keep", action="store_true", help=keep)
    scheduler = "run on the workers of a Dask scheduler (tcp://HOST:8786), or of one started here (local)"
    batch.add_argument("--scheduler", metavar="ADDRESS", help=scheduler)
    share = "do the Kth of N shares of the parts alone, as a task of an array of jobs does"
    batch.add_argument("--share", metavar="K/N", type=share_of, default=(1, 1), help=share)
    add_job_options(batch)
    batch.add_argument("-q", "--quiet", action="store_true", help="print no line for each part")
    batch.add_argument("-v", "--verbose", action="store_true", help="print the steps of each part as lines")


def run_batch(options: argparse.Namespace) -> int:
    """`bonecam batch`: the NC programs of several parts."""
    from bonecam.batch import Wanted, cluster_executor
    from bonecam.cli.batch_display import BatchDisplay

    address = options.scheduler
    cluster = cluster_executor(address, options.jobs) if address else nullcontext()
    with cluster as executor, BatchDisplay(options) as shown:
        outcomes = bonecam.convert_many(
            options.parts,
            options.output,
            job_of(options),
            jobs=options.jobs,
            executor=executor,
            resume=options.resume,
            share=options.share,
            wanted=Wanted(html=options.html, sheet=options.sheet, keep=options.keep),
            told=shown.told,
            progress=shown.progress,
        )
    return int(any(outcome.state == "failed" for outcome in outcomes))
