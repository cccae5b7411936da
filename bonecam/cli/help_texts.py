"""Texts of the command line's help: exit codes, kinds of parts, examples of every command."""

EXIT_CODES = """Exit codes: 0 done; 1 a part of a batch failed; 2 wrong input, job or call (one line on stderr);
129, 130, 143 stopped by SIGHUP, Ctrl-C, SIGTERM."""
PART = "STL, PLY, OBJ or OFF mesh; STEP, IGES, SAT or DXF part; point cloud; rows of points; saved .tspline"
EXAMPLES = {
    "convert": """
  bonecam convert bone.stl --units m -o bone.h
  bonecam convert bone.stl -o bone.h --set stock.diameter=15 --set stock.length=37 --keep look --report bone.json
  bonecam convert bone.stl -o bone.ngc --machine linuxcnc-xyzbc""",
    "demo": """
  bonecam demo -o phalanx.h --keep look
  bonecam demo --impeller --keep wheel --html wheel.html --sheet sheet.html""",
    "levels": """
  bonecam levels bone.stl --units m -o look --set stock.kind=cylinder --set levels.roughing_depth=1""",
    "finish": """
  bonecam finish blade.txt --part hub.stl --obstacle blades.stl -o blade.h --set finishing.overhang=45""",
    "blades": """
  bonecam blades blade.txt --count 11 --hub hub.stl -o wheel.h --keep look --job wheel.toml
  bonecam blades section_*.txt --columns "x r*theta r" --axis=-x --count 15 --hub flow.txt -o wheel.h""",
    "shell": """
  bonecam shell bone.stl --units m -o shell.stl --covered 0.6""",
    "simulate": """
  bonecam simulate bone.h --keep look
  bonecam simulate look/program.h""",
    "probe": """
  bonecam probe look -o probe.csv --picture probe.png --program probe.h""",
    "compare": """
  bonecam compare bone.stl --units m -o study --job job.toml --set mechanics.refuse=false""",
    "post": """
  bonecam post look/toolpath.apt -o bone.mpf --machine hermle-c600u --controller siemens-840d
  bonecam post bone.apt --part bone.ply -o bone.mpf --machine hermle-c600u --controller siemens-840d
  bonecam post bone.h --part bone.ply -o bone.ngc --from-machine mikron-ucp600 --from-controller heidenhain \\
      --machine linuxcnc-xyzac --controller linuxcnc""",
    "view": """
  bonecam view look -o bone.html""",
    "batch": """
  bonecam batch scans/*.stl -o programs --job job.toml --jobs 4 --resume""",
    "script": """
  bonecam script levels.mlx -i bone.stl -o layers""",
    "filters": """
  bonecam filters generate_morph_levels""",
    "job": """
  bonecam job --set levels.roughing_depth=1 > job.toml
  bonecam job --schema > job.schema.json""",
    "machines": """
  bonecam machines
  bonecam machines check my-mill.toml""",
    "dialects": """
  bonecam dialects heidenhain
  bonecam dialects check my-control.toml""",
    "materials": """
  bonecam materials titanium""",
    "tools": """
  bonecam tools
  bonecam tools --tools shop.json
  bonecam convert bone.stl -o bone.h --tools shop.json --set finishing.preset=3""",
    "completion": """
  bonecam completion bash > ~/.local/share/bash-completion/completions/bonecam""",
}
