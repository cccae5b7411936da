"""`bonecam post`."""

import argparse

from bonecam.cli.command import JOB, PROGRAM, VERBOSITY, Command, argument, call_with, kept_job
from bonecam.errors import JobError


def run_post(options: argparse.Namespace) -> int:
    """`bonecam post`: the program of paths that were made elsewhere."""
    origin = options.from_machine, options.from_controller
    if origin[0] is None and origin[1] is not None:
        raise JobError("--from-controller needs the machine of the program too: give --from-machine")
    job = kept_job(options, options.paths)
    from bonecam_plugins.reposting.posting import post

    posted = call_with(post, options, job=job, origin=None if origin[0] is None else origin)
    if not options.quiet:
        print(posted.summary)
    return 0


POST = Command(
    run_post,
    "Post, prove and simulate cutter location data (APT) of another system, or a program of another control.",
    [
        argument("paths", metavar="PATHS", help="APT statements, or with --from-machine an NC program"),
        PROGRAM,
        argument(
            "--part",
            dest="part_file",
            metavar="MESH",
            help="solid that is not gouged, in the paths' frame: a mesh, or a kept folder or surface (that of --keep)",
        ),
        argument(
            "--keep",
            metavar="DIR",
            help="a folder that `convert --keep` wrote: its stock is cut, without --job by its job (that of PATHS)",
        ),
        argument("--from-machine", metavar="NAME", help="machine that the program PATHS is for"),
        argument("--from-controller", metavar="NAME", help="controller that the program PATHS is for"),
        *JOB,
        *VERBOSITY,
    ],
    examples="""
  bonecam post look/toolpath.apt -o bone.mpf --machine hermle-c600u --controller siemens-840d
  bonecam post bone.apt --part bone.ply -o bone.mpf --machine hermle-c600u --controller siemens-840d
  bonecam post bone.h --part bone.ply -o bone.ngc --from-machine mikron-ucp600 --from-controller heidenhain \\
      --machine linuxcnc-xyzac --controller linuxcnc""",
)
