"""Lists of cutters: the catalogue, and a shop's own in each of the formats that shops have."""

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import bonecam
from bonecam.batch.run import BatchPart, fingerprint
from bonecam.cli import main
from bonecam.cli.catalogues import described
from bonecam.errors import JobError
from bonecam.job import Job, ToolJob
from bonecam.job.tool_list import ENDINGS, known_cutters, read_tool_list, tool_list
from bonecam.machine.bodies import Frustum
from bonecam.tool.cutter import Cutter

CHUCK = {
    "description": "Shrink-fit 6",
    "gaugeLength": 80,
    "guid": "0",
    "segments": [
        {"height": 60, "lower-diameter": 12, "upper-diameter": 21},
        {"height": 20, "lower-diameter": 63, "upper-diameter": 63},
        {"height": 30, "lower-diameter": 44, "upper-diameter": 30},
    ],
    "type": "holder",
    "unit": "millimeters",
}
"""A holder as Fusion writes it: the last piece is the taper, above the gauge line."""


def fusion_tool(number: int, description: str, kind: str = "ball end mill", **changes: Any) -> dict[str, Any]:
    """A tool as Fusion exports it, with other values of its geometry."""
    geometry = {
        "CSP": False,
        "DC": 6,
        "HAND": True,
        "LB": 24,
        "LCF": 13,
        "NOF": 2,
        "NT": 1,
        "OAL": 57,
        "RE": 3,
        "SFDM": 6,
        "TA": 0,
        "assemblyGaugeLength": 104,
        "shoulder-diameter": 5.8,
        "shoulder-length": 20,
        **{key: value for key, value in changes.items() if key not in ("unit", "holder", "shaft")},
    }
    tool = {
        "BMC": "carbide",
        "description": description,
        "geometry": {key: value for key, value in geometry.items() if value is not None},
        "guid": "00000000-0000-0000-0000-000000000000",
        "holder": CHUCK,
        "post-process": {"break-control": False, "comment": "", "length-offset": number, "number": number},
        "product-id": "",
        "start-values": {"presets": [{"name": "Aluminium", "n": 18000, "v_f": 1800}]},
        "type": kind,
        "unit": "millimeters",
        "vendor": "",
    } | {key: value for key, value in changes.items() if key in ("unit", "holder", "shaft")}
    return {key: value for key, value in tool.items() if value is not None}


def fusion(folder: Path, *tools: dict[str, Any], name: str = "shop.json") -> str:
    """A tool library of Fusion."""
    (folder / name).write_text(json.dumps({"data": tools, "version": 36}), encoding="utf-8")
    return str(folder / name)


def written(folder: Path, name: str, text: str) -> str:
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


def only(file: str) -> ToolJob:
    """The cutter of a list of one."""
    (listed,) = read_tool_list(file)
    return listed.tool


# --- the catalogue


def test_the_catalogue_has_balls_of_one_to_ten_millimetres_that_fit_their_chucks():
    listed = read_tool_list("")
    assert listed == read_tool_list("catalogue")
    diameters = {2 * one.tool.radius for one in listed}
    assert diameters == {1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0}
    assert {f"ball-{diameter:g}" for diameter in diameters} <= {one.name for one in listed}
    assert len({one.name for one in listed}) == len(listed)
    for one in listed:
        cutter = Cutter.from_job(1, "roughing", replace(one.tool, spindle=9000.0, feed=900.0))
        assert one.tool.shape == "ball"
        assert one.tool.number == 0
        assert one.stated["source"], one.name
        if one.name != "ball-1":  # whose shank of 4 mm is a piece of its holder
            assert cutter.holder[0].diameter == cutter.shank_diameter + 6.0, "a wall of 3 mm"
            assert 20.0 <= cutter.overhang <= 35.0


def test_a_scallop_that_a_list_does_not_state_stays_that_of_the_section():
    job = Job().with_values(roughing={"preset": "ball-6"}, finishing={"preset": "ball-3"})
    assert (job.roughing.scallop, job.finishing.scallop) == (Job().roughing.scallop, Job().finishing.scallop)
    assert (job.roughing.radius, job.roughing.neck_diameter) == (3.0, 5.8)


# --- Fusion


def test_a_library_of_fusion_is_read_with_neck_stick_out_and_holder_up_to_the_gauge_line(tmp_path):
    file = fusion(
        tmp_path,
        fusion_tool(3, "6 mm ball"),
        fusion_tool(4, "bull", "bull nose end mill", RE=1.0),
        fusion_tool(5, "flat", "flat end mill", RE=0, NOF=6),
        fusion_tool(6, "drill 5", "drill", SIG=118),
        fusion_tool(7, "tapered", TA=3),
        CHUCK,
    )
    found = tool_list(file)
    assert [one.name for one in found.tools] == ["6 mm ball"]
    ball = found.tools[0].tool
    assert ball == ToolJob(
        number=3,
        flutes=2,
        radius=3.0,
        flute_length=13.0,
        shank_diameter=6.0,
        neck_diameter=5.8,
        neck_length=20.0,
        overhang=24.0,
        holder="60.0 12.0 21.0, 20.0 63.0 63.0",
    )
    ends = {"bull nose end mill": 1, "flat end mill": 1, "drill": 1, "tapered ball end mill": 1, "holder": 1}
    assert found.left_out == ends


def test_tools_files_of_fusion_are_zips_or_plain(tmp_path):
    plain = fusion(tmp_path, fusion_tool(3, "6 mm ball"), name="plain.tools")
    packed = tmp_path / "packed.tools"
    with zipfile.ZipFile(packed, "w") as file:
        file.write(plain, "tools.json")
    assert read_tool_list(str(packed)) == read_tool_list(plain)
    content = io.BytesIO(packed.read_bytes()).getvalue()
    packed.write_bytes(content[:200])
    with pytest.raises(JobError, match=r"packed\.tools: "):
        read_tool_list(str(packed))


def test_each_tool_of_fusion_has_its_unit_and_its_holder_another(tmp_path):
    inch = {"DC": 0.25, "LB": 1.0, "LCF": 0.5, "SFDM": 0.25, "RE": 0.125, "shoulder-length": 0.5}
    tool = only(fusion(tmp_path, fusion_tool(1, "1/4 ball", unit="inches", **inch)))
    assert (tool.radius, tool.overhang, tool.flute_length, tool.neck_length) == (3.175, 25.4, 12.7, 0.0)
    assert tool.holder_stack[0] == Frustum(60.0, 12.0, 21.0)
    same = {**CHUCK, "unit": "inches", "gaugeLength": 2.0}
    tool = only(fusion(tmp_path, fusion_tool(1, "1/4 ball", unit="inches", **inch, holder=same)))
    assert tool.holder_stack == (Frustum(50.8, 304.8, 312.42),), "cut at the gauge line"
    with pytest.raises(JobError, match=r"tool 1 '1/4 ball': unit = None, millimeters: give millimeters or inches"):
        read_tool_list(fusion(tmp_path, fusion_tool(1, "1/4 ball", unit=None)))


@pytest.mark.parametrize(
    ("changes", "neck"),
    [
        # flutes, then shank: the shoulder ends with the flutes
        ({"shoulder-length": 13}, (0.0, 0.0, 6.0)),
        # a ball of 2 on a shank of 6: neck, cone, shank; the cone is held by the shank
        (
            {"DC": 2, "LCF": 3, "shoulder-length": 3, "shoulder-diameter": 2, "shaft": [(8, 1.9, 1.9), (3, 1.9, 6)]},
            (1.9, 11.0, 6.0),
        ),
        # a shoulder thicker than the neck of the shaft
        ({"DC": 2, "LCF": 3, "shoulder-length": 5, "shaft": [(8, 1.5, 1.9), (3, 1.9, 6)]}, (2.0, 11.0, 6.0)),
        # a shaft that is wider than the cutter from the flutes on, and wider than the shank
        ({"DC": 2, "LCF": 3, "shoulder-length": 3, "shaft": [(8, 2.5, 7)]}, (0.0, 0.0, 7.0)),
        # what is thin up to the holder is the shank
        ({"shoulder-length": 30}, (0.0, 0.0, 5.8)),
        # no thinner than the shank
        ({"shoulder-diameter": 6}, (0.0, 0.0, 6.0)),
    ],
)
def test_shoulder_and_shaft_of_fusion_become_a_neck_and_a_shank_that_hold_them(changes, neck, tmp_path):
    if changes.get("DC") == 2:
        changes = {"shoulder-diameter": 2, **changes}
    pieces = [
        {"height": height, "lower-diameter": lower, "upper-diameter": upper}
        for height, lower, upper in changes.get("shaft", [])
    ]
    shaft = {"shaft": {"segments": pieces, "type": "shaft"}} if pieces else {}
    tool = only(fusion(tmp_path, fusion_tool(3, "ball", **{**changes, **shaft})))
    assert (tool.neck_diameter, tool.neck_length, tool.shank_diameter) == neck


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"holder": None}, "tool 3 'ball': states no holder: state it in its"),
        ({"LB": None, "LCF": None}, r"tool 3 'ball': states no flute_length, overhang"),
        ({"DC": 2, "shoulder-length": None}, "tool 3 'ball': states no neck_length"),
        ({"DC": "six"}, "states no radius"),
        ({"LB": 12}, r"tool 3 'ball': overhang = 12: give more than flute_length \(13 mm\)"),
        ({"LCF": 2}, r"flute_length = 2: give at least the ball's radius \(3 mm\)"),
        ({"SFDM": 14, "shoulder-length": 13}, r"shank_diameter = 14: give at most holder_diameter \(12 mm\)"),
    ],
)
def test_what_a_library_of_fusion_lacks_is_asked_for_by_name(changes, why, tmp_path):
    file = fusion(tmp_path, fusion_tool(3, "ball", **changes))
    with pytest.raises(JobError, match=rf"shop\.json: .*{why}") as caught:
        read_tool_list(file)
    assert "\n" not in str(caught.value)
    assert ('from = "shop.json"' in str(caught.value)) == ("states no" in why)


def test_all_that_is_wrong_in_a_list_is_told_at_once(tmp_path):
    tools = [fusion_tool(number, f"ball {number}", holder=None) for number in (1, 2)]
    with pytest.raises(JobError, match=r"tool 1 'ball 1': states no holder; tool 2 'ball 2': states no holder"):
        read_tool_list(fusion(tmp_path, *tools))


# --- FreeCAD


def bit(folder: Path, name: str, shape: str, **sizes: str) -> str:
    """A toolbit as FreeCAD writes it."""
    content = {"version": 2, "name": name, "shape": f"{shape}.fcstd", "parameter": sizes, "attribute": {}}
    return written(folder, f"Bit/{name}.fctb", json.dumps(content))


def freecad(folder: Path) -> str:
    """A library of FreeCAD with its toolbits in the folder beside it."""
    (folder / "Bit").mkdir()
    sizes = {"CuttingEdgeHeight": "13.0000 mm", "Length": "57.0000 mm"}
    bit(folder, "6mm_Ball_End", "ballend", Diameter="6.0000 mm", ShankDiameter="6.0000 mm", **sizes)
    bit(folder, "Torus", "torus", Diameter="6,00 mm", TorusRadius="1,00 mm", ShankDiameter="6 mm", **sizes)
    bit(folder, "5mm_Drill", "drill", Diameter="5.0000 mm", TipAngle="119.0000 °")
    bits = [(3, "6mm_Ball_End"), (4, "Torus"), (5, "5mm_Drill")]
    library = {"tools": [{"nr": nr, "path": f"{name}.fctb"} for nr, name in bits], "version": 1}
    return written(folder, "Library/Default.fctl", json.dumps(library))


def test_toolbits_of_freecad_are_completed_by_a_list_that_names_their_library(tmp_path):
    library = freecad(tmp_path)
    with pytest.raises(JobError, match=r"Default\.fctl: tool 3 '6mm_Ball_End': states no overhang, holder"):
        read_tool_list(library)
    text = 'from = "Default.fctl"\noverhang = 24\nholder = "60 12 21, 20 63"\n'
    found = tool_list(written(tmp_path, "Library/mill.toml", text))
    (ball,) = (one.tool for one in found.tools)
    assert (ball.number, ball.radius, ball.flute_length, ball.overhang) == (3, 3.0, 13.0, 24.0)
    assert found.left_out == {"torus": 1, "drill": 1}
    names = {file.name for file in found.files}
    assert names == {"mill.toml", "Default.fctl", "6mm_Ball_End.fctb", "Torus.fctb", "5mm_Drill.fctb"}


def test_a_toolbit_alone_lacks_its_number_and_a_thick_shank_asks_for_the_neck(tmp_path):
    (tmp_path / "Bit").mkdir()
    sizes = {"Diameter": '1/8 "', "CuttingEdgeHeight": "6 mm", "ShankDiameter": "6 mm"}
    file = bit(tmp_path, "ball", "ballend", **sizes)
    with pytest.raises(JobError, match=r"'ball': states no number, overhang, holder, neck_length"):
        read_tool_list(file)
    values = "number = 2\noverhang = 20\nholder_diameter = 30\nholder_length = 60\nneck_length = 0"
    tool = only(written(tmp_path, "Bit/own.toml", f'from = "ball.fctb"\n[[tool]]\nname = "ball"\n{values}\n'))
    assert (tool.radius, tool.number, tool.holder_stack) == (1.5875, 2, (Frustum(60.0, 30.0, 30.0),))
    with pytest.raises(JobError, match=r"bad\.fctb: Diameter = '6 parsecs': give a length with its unit"):
        read_tool_list(bit(tmp_path, "bad", "ballend", Diameter="6 parsecs"))


def test_a_library_that_names_a_missing_toolbit_is_refused(tmp_path):
    library = freecad(tmp_path)
    (tmp_path / "Bit" / "Torus.fctb").unlink()
    with pytest.raises(JobError, match=r"Default\.fctl: names Torus\.fctb, which is neither beside it nor in"):
        read_tool_list(library)


# --- LinuxCNC

TABLE = """T1 P1 D3 Z+0.511 ;1/8 end mill
T3 P3 X0 D6.0 Z+50.2 ;6 mm ball
T4 P4 D2 ; 2 mm ball

; an empty pocket
T99 P99 Z+0.1 ;probe
"""
COMPLETED = """from = "tool.tbl"
units = "mm"
holder = "slim"

[holders]
slim = [[60, 12, 21], [20, 63]]

[[tool]]
number = 3
shape = "ball"
flute_length = 13
shank_diameter = 6
overhang = 24

[[tool]]
name = "2 mm ball"
shape = "ball"
flute_length = 3
shank_diameter = 4
neck_diameter = 1.9
neck_length = 11
overhang = 20
holder = "60 10 19, 20 63"
"""


def linuxcnc(folder: Path, text: str = COMPLETED) -> str:
    written(folder, "tool.tbl", TABLE)
    return written(folder, "mill.toml", text)


def test_a_tool_table_of_linuxcnc_is_completed_by_a_list_beside_it(tmp_path):
    found = tool_list(linuxcnc(tmp_path))
    assert [(one.name, one.tool.number, one.tool.radius) for one in found.tools] == [
        ("6 mm ball", 3, 3.0),
        ("2 mm ball", 4, 1.0),
    ]
    assert [one.tool.holder_stack[0].diameter for one in found.tools] == [12.0, 10.0]
    assert found.left_out == {"without a stated shape": 2}
    written(tmp_path, "tool.tbl", TABLE.replace("D6.0", "D0.25").replace("D2 ", "D.078740 "))
    inch = read_tool_list(written(tmp_path, "mill.toml", COMPLETED.replace('"mm"', '"inch"')))
    assert [one.tool.radius for one in inch] == [3.175, pytest.approx(1.0, abs=1e-5)]


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('units = "mm"\n', "", r'tool\.tbl: a tool table has the unit of its machine.*units = "mm"'),
        (
            "overhang = 24\n",
            "",
            r"mill\.toml: tool 3 '6 mm ball': states no overhang: state it there, or above the first \[\[tool",
        ),
        ("number = 3", "number = 33", r"\[\[tool\]\] tool 33: tool\.tbl has none: use tool 1 '1/8 end mill', "),
        ("number = 3\n", "", r"\[\[tool\]\]: give the number or the name that it has in tool\.tbl"),
        ('shape = "ball"', 'shape = "bal"', "shape = 'bal': only balls cut: give ball, or leave the tool out"),
        ("overhang = 24", "overhng = 24", r"\[\[tool\]\] tool 3: unknown key 'overhng' \(did you mean 'overhang'\?\)"),
        ("overhang = 24", "overhang = 'x'", "tool 3 '6 mm ball': overhang = 'x': give a number"),
        ('"tool.tbl"', '"tool.xls"', r"from = 'tool\.xls': give a file that ends in \.json"),
        ('"tool.tbl"', '"none.tbl"', r"none\.tbl: No such file or directory"),
        ('units = "mm"', 'units = "furlong"', "units = 'furlong': give mm or inch"),
        ('units = "mm"', 'units = "mm"\nonly = [3, 5]', "only: there is no tool 5: use tool 1"),
        ("[holders]\nslim", "[holders]\nother", "tool 3 '6 mm ball': holder = 'slim': 'slim' is no number"),
    ],
)
def test_a_list_that_does_not_complete_its_file_is_one_line(old, new, why, tmp_path):
    assert old in COMPLETED
    with pytest.raises(JobError, match=why) as caught:
        read_tool_list(linuxcnc(tmp_path, COMPLETED.replace(old, new, 1)))
    assert "\n" not in str(caught.value)


def test_a_tool_table_alone_says_what_it_lacks(tmp_path):
    linuxcnc(tmp_path)
    with pytest.raises(JobError, match=r'states no shape, flutes, shank, stick-out or holder: .* from = "tool\.tbl"'):
        read_tool_list(str(tmp_path / "tool.tbl"))
    written(tmp_path, "tool.tbl", "T1 P1 D3\n1 2 3\n")
    with pytest.raises(JobError, match=r"tool\.tbl: line 2: is none of a tool table"):
        read_tool_list(str(tmp_path / "mill.toml"))


def test_of_two_tools_with_one_number_a_list_names_the_one_that_it_completes(tmp_path):
    fusion(tmp_path, fusion_tool(1, "short", holder=None), fusion_tool(1, "long", holder=None))
    text = 'from = "shop.json"\nholder = "60 12 21, 20 63"\n[[tool]]\nnumber = 1\n{}overhang = 33\n'
    with pytest.raises(JobError, match=r"\[\[tool\]\] tool 1: shop\.json has 2: give number and name"):
        read_tool_list(written(tmp_path, "mill.toml", text.format("")))
    short, long = read_tool_list(written(tmp_path, "mill.toml", text.format('name = "long"\n')))
    assert (short.tool.overhang, long.tool.overhang) == (24.0, 33.0)


def test_a_list_gives_a_tool_the_name_or_the_number_that_its_file_lacks(tmp_path):
    nameless, unnumbered = fusion_tool(1, ""), fusion_tool(2, "ball")
    del unnumbered["post-process"]
    fusion(tmp_path, nameless, unnumbered)
    text = 'from = "shop.json"\n[[tool]]\nnumber = 1\nname = "mine"\n[[tool]]\nname = "ball"\nnumber = 7\n'
    tools = read_tool_list(written(tmp_path, "mill.toml", text))
    assert [(listed.name, listed.tool.number) for listed in tools] == [("mine", 1), ("ball", 7)]
    text = 'from = "shop.json"\n[[tool]]\nnumber = 9\n'
    with pytest.raises(JobError, match=r"\[\[tool\]\] tool 9: shop\.json has none: use tool 1, 'ball'"):
        read_tool_list(written(tmp_path, "mill.toml", text))


def test_a_list_may_use_some_tools_of_its_file_and_mend_what_is_stated(tmp_path):
    fusion(tmp_path, fusion_tool(1, "ball"), fusion_tool(2, "broken", LB=None, holder=None))
    text = 'from = "shop.json"\nonly = ["ball"]\nholder = "9 99"\n[[tool]]\nnumber = 1\nneck_length = 0.0\n'
    tool = only(written(tmp_path, "mill.toml", text))
    assert (tool.neck_diameter, tool.holder_stack[0].diameter) == (0.0, 12.0), "its own holder, and no neck"


# --- tables


@pytest.mark.parametrize(("apart", "point"), [(",", "."), (";", ","), ("\t", ".")])
def test_a_table_is_read_with_commas_semicolons_or_tabs(apart, point, tmp_path):
    rows = [
        "Number|Name|Shape|Diameter|Flute length|Shank diameter|Overhang|Holder|Price",
        '3|6 mm ball|ball|6.0|13.0|6.0|24.5|"60 12 21, 20 63"|31.90',
        "4|drill|Drill|5.0|||||",
        "",
    ]
    text = "\n".join(rows).replace(".", point).replace("|", apart)
    found = tool_list(written(tmp_path, "shop.csv", text))
    (listed,) = found.tools
    assert (listed.name, listed.tool.number, listed.tool.radius) == ("6 mm ball", 3, 3.0)
    assert (listed.tool.overhang, len(listed.tool.holder_stack)) == (24.5, 2)
    assert found.left_out == {"drill": 1}


def test_a_table_in_inches_names_its_unit_in_the_list_that_completes_it(tmp_path):
    written(
        tmp_path, "shop.csv", "number,name,shape,diameter,flute_length,shank_diameter,holder\n1,b,ball,.25,.5,.25,2 1\n"
    )
    tool = only(written(tmp_path, "mill.toml", 'from = "shop.csv"\nunits = "inch"\noverhang = 25.0\n'))
    assert (tool.radius, tool.flute_length, tool.overhang) == (3.175, 12.7, 25.0)
    assert tool.holder_stack == (Frustum(50.8, 25.4, 25.4),)


@pytest.mark.parametrize(
    ("row", "why"),
    [
        ("3,wide,8,6,24,60 12,ball", r"line 2: diameter = 'wide' is no number"),
        ("3.5,6,8,6,24,60 12,ball", r"line 2: number = '3\.5' is no whole number"),
        ("3,4,,4,24,60 12,ball", r"tool 3: states no flute_length"),
        (",4,8,4,24,60 12,ball", r"states no number"),
        ("3,4,8,6,24,60 12,ball", r"tool 3: states no neck_length"),
        ("3,4,8,4,24,60 12,", r"no ball end \(1 without a stated shape\): state `shape` in its \[\[tool\]\] of a"),
        ('3,4,8,4,24,"60 12', r"unexpected end of data"),
    ],
)
def test_a_table_that_is_wrong_or_lacks_something_is_one_line(row, why, tmp_path):
    head = "number,diameter,flute_length,shank_diameter,overhang,holder,shape"
    with pytest.raises(JobError, match=rf"shop\.csv: .*{why}"):
        read_tool_list(written(tmp_path, "shop.csv", f"{head}\n{row}\n"))


# --- bonecam's own, and what holds of all


def test_a_file_of_one_cutter_is_a_list_of_its_name(tmp_path):
    text = "radius = 1.5\nflute_length = 4.5\nshank_diameter = 6.0\noverhang = 28.0\nholder = [[35, 10, 17]]\n"
    (listed,) = read_tool_list(written(tmp_path, "ball-3.toml", text))
    assert (listed.name, listed.tool.number, listed.tool.neck_length) == ("ball-3", 0, 0.0)
    with pytest.raises(JobError, match=r"ball-3\.toml: 'ball-3': states no overhang, holder"):
        read_tool_list(written(tmp_path, "ball-3.toml", text.partition("overhang")[0]))


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("content", [b"", b"PK\x03\x04", b"\x00\xff\xfe", b"{" * 5000, b"[1, 2]", b'{"data": [1]}'])
def test_a_file_that_is_no_list_is_one_line(ending, content, tmp_path):
    (tmp_path / f"shop{ending}").write_bytes(content)
    with pytest.raises(JobError, match=rf"shop\{ending}") as caught:
        read_tool_list(str(tmp_path / f"shop{ending}"))
    assert "\n" not in str(caught.value)


def test_a_list_that_there_is_not_is_one_line(tmp_path):
    with pytest.raises(JobError, match=r"'catalog': is no list of cutters \(did you mean 'catalogue'\?\): use one"):
        read_tool_list("catalog")
    with pytest.raises(JobError, match=r"gone\.json: No such file or directory: give a list of cutters"):
        read_tool_list(str(tmp_path / "gone.json"))


@pytest.fixture
def shop(tmp_path, monkeypatch):
    """The list `shop` in the user's folder: two balls of Fusion, one of the catalogue's name."""
    monkeypatch.setenv("BONECAM_HOME", str(tmp_path))
    folder = tmp_path / "toollists"
    folder.mkdir()
    fusion(folder, fusion_tool(3, "6 mm ball"), fusion_tool(8, "ball-2", DC=2, **{"shoulder-diameter": 1.9}))
    return "shop"


def test_a_preset_is_of_the_job_s_list_by_name_or_number_then_of_the_catalogue(shop):
    job = Job(nc={"tools": shop}, roughing={"preset": "3"}, finishing={"preset": "ball-2"}, fine={"preset": "ball-1"})
    assert (job.roughing.number, job.roughing.radius, job.roughing.overhang) == (3, 3.0, 24.0)
    assert (job.finishing.number, job.finishing.shank_diameter) == (8, 6.0), "the shop's"
    assert job.fine == Job(fine={"preset": "ball-1"}).fine
    assert Job(nc=job.nc, roughing={"preset": "6 mm ball"}).roughing.radius == 3.0
    stated = Job(nc=job.nc, roughing={"preset": "8", "overhang": 30.0})
    assert (stated.roughing.radius, stated.roughing.overhang) == (1.0, 30.0)
    with pytest.raises(JobError, match=r"\[roughing\] preset = '9': use one of 6 mm ball, ball-2, ball-1,"):
        job.with_values(roughing={"preset": "9"})
    with pytest.raises(JobError, match=r"\[roughing\] preset = '6 mm bal' \(did you mean '6 mm ball'\?\)"):
        job.with_values(roughing={"preset": "6 mm bal"})


def test_two_cutters_of_one_name_are_told_apart_by_their_numbers(tmp_path):
    file = fusion(tmp_path, fusion_tool(1, "ball"), fusion_tool(2, "ball", LB=30))
    with pytest.raises(JobError, match=r"preset = 'ball': these are 2 cutters: .* \(1, 2\)"):
        Job(nc={"tools": file}, finishing={"preset": "ball"})
    assert Job(nc={"tools": file}, finishing={"preset": "2"}).finishing.overhang == 30.0


def test_cutters_are_known_by_the_names_that_a_preset_has_for_them(tmp_path):
    tools = fusion(tmp_path, fusion_tool(3, "6 mm"), fusion_tool(4, "6 mm", LB=40), fusion_tool(5, "ball-4"))
    known = known_cutters(tools)
    assert [listed.name for listed in known] == ["3", "4", "ball-4"]
    for listed in known:
        job = Job().with_values(nc={"tools": tools}, roughing={"preset": listed.name, "scallop": 0.03})
        assert job.roughing == listed.in_section(replace(ToolJob(scallop=0.03), preset="auto"))
        assert listed.in_section(ToolJob(number=9, spindle=7000.0)).number == 9
        assert listed.in_section(ToolJob()).number == listed.tool.number


def test_a_job_file_names_a_list_beside_it_and_the_option_another(shop, tmp_path, monkeypatch, capsys):
    fusion(tmp_path, fusion_tool(3, "mine", LB=31), name="mine.json")
    text = '[finishing]\npreset = "3"\n[nc]\ntools = "mine.json"\n'
    file = written(tmp_path, "job.toml", text)
    job = bonecam.read_job(file)
    assert (job.finishing.overhang, job.nc.tools) == (31.0, str(tmp_path / "mine.json"))
    assert bonecam.read_job(written(tmp_path, "again.toml", bonecam.write_job(job))) == job
    monkeypatch.chdir(tmp_path)
    assert main(["job", "--job", file, "--tools", "shop"]) == 0
    printed = written(tmp_path, "told.toml", capsys.readouterr().out)
    assert bonecam.read_job(printed).finishing.overhang == 24.0
    assert main(["job", "--tools", "none.json"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_job_whose_list_cannot_be_read_is_refused_before_any_work(tmp_path):
    job = Job(nc={"tools": str(tmp_path / "gone.json")})
    with pytest.raises(JobError, match=r"gone\.json: No such file"):
        bonecam.convert(tmp_path / "none.stl", job, program=tmp_path / "p.h")


def test_a_part_is_made_again_where_a_file_of_its_list_has_changed(tmp_path):
    part = written(tmp_path, "part.stl", "")
    job = Job(nc={"tools": linuxcnc(tmp_path)})
    before = fingerprint(BatchPart(Path(part), "part", job))
    written(tmp_path, "tool.tbl", TABLE.replace("D6.0", "D6.1"))
    assert fingerprint(BatchPart(Path(part), "part", job)) != before


def test_the_command_tools_lists_checks_and_shows_the_cutters_of_a_list(shop, tmp_path, capsys):
    assert main(["tools"]) == 0
    printed = capsys.readouterr().out.splitlines()
    catalogue = read_tool_list("")
    assert [line.split()[0] for line in printed] == [one.name for one in catalogue]
    assert all(described(one.tool) in line for one, line in zip(catalogue, printed, strict=True))
    assert main(["tools", "--tools", shop]) == 0
    assert "ball-2     tool 8: ball of 2 mm" in capsys.readouterr().out
    assert main(["tools", "8", "--tools", shop]) == 0
    assert capsys.readouterr().out.startswith("# ball-2: tool 8: ball of 2 mm")
    for one in catalogue:
        assert main(["tools", one.name]) == 0
        own = written(tmp_path, "mine.toml", capsys.readouterr().out)
        assert only(own) == one.tool
    assert main(["tools", "check", own]) == 0
    assert capsys.readouterr().out == f"{own}: a list of cutters as it should be\n"
    written(tmp_path, "tools/ball-6.toml", Path(own).read_text().replace("35.0", "36.0"))
    assert main(["tools", "ball-6"]) == 0
    assert "overhang = 36.0" in capsys.readouterr().out, "the user's own comes first"
    assert main(["tools"]) == 0
    assert sum(line.startswith("ball-6 ") for line in capsys.readouterr().out.splitlines()) == 1
    lathe = fusion(tmp_path, fusion_tool(1, "ball"), fusion_tool(2, "drill", "drill"), name="lathe.json")
    assert main(["tools", "--tools", lathe]) == 0
    assert capsys.readouterr().out.endswith("left out: 1 drill\n")
