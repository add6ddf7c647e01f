"""Edits that change nothing of what a program does are accepted; their neighbours are not."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tests.post.cases import refusal, renumbered
from tests.post.test_handshakes import ASKED, program, settings

from kerfpath.dynamics import Load
from kerfpath.job.program_file import TextFolder
from kerfpath.post import language, post
from kerfpath.post.harmless import HARMLESS as HARMLESS_LINES
from kerfpath.post.harmless import LinePattern, compact, without_remark


@cache
def made_of(name):
    return program(name, ("one", "two"), handshakes=ASKED)


@cache
def files_of(name):
    return post(made_of(name), name, settings(name))


def folder(path, name):
    return TextFolder(path, language(name).encodings)


def why_refused(files, name, main=None):
    return refusal(files, name, made_of(name), settings(name), main)


# Each edit is a pattern in a file (by the end of its name) and what it becomes.
HARMLESS = {
    "krl": [
        (".src", "&REL 1", "&REL 57"),
        (".dat", "&REL 1", "&REL 57"),
        (".src", "&REL 1", "&REL 1\r\n&COMMENT cut of the pillar"),
        (".src", "&REL 1", r"&REL 1\r\n&PARAM EDITMASK = *"),
        (".src", "&REL 1", r"&REL 1\r\n&PARAM TEMPLATE = C:\\KRC\\Roboter\\Template\\vorgabe"),
        (".src", "&ACCESS RVP", "&ACCESS RVO"),
        (".src", "&ACCESS RVP\r\n&REL 1", "&REL 3\r\n&ACCESS RVP"),
        (".src", r"DEF one\(\)", "DEF one ( )"),
        (".src", r"DEF one\(\)", "def ONE()"),
        (".src", r"one\(\)\r\nENDIF", "One()\r\nEndIf"),
        (".src", r"\$OUT\[3\]=TRUE", "$OUT [ 3 ] = true"),
        (".src", r"\$VEL\.CP=0\.100000", "$VEL.CP = 0.1"),
        (".src", r"LIN \{X ", "  LIN  { X  "),
        (".src", r"(LIN \{.*\})\r", r"\1  ; the first corner, für J. Müller\r"),
        (".src", r"WAIT SEC 0\.100", "WAIT SEC 0.1"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n;FOLD cut %{PE}\r\n\r\n;ENDFOLD\r\n"),
        (".src", r"HALT\r\n", "halt\r\n"),
        (
            ".src",
            r"(\$TOOL=\{.*\})\r\n",
            r"\1\r\n$LOAD={M 12.0,CM {X 10.0,Y 0.0,Z 90.0,A 0.0,B 0.0,C 0.0},"
            r"J {X 0.1,Y 0.1,Z 0.1}}\r\n",
        ),
        (".dat", r"ENDDAT\r\n", "ENDDAT"),
        (
            ".dat",
            r"ENDDAT",
            "DECL E6POS XP1={X 10.0,Y 0.0,Z 90.0,A 0.0,B 0.0,C 0.0}\r\n"
            "DECL LDAT LCPDAT1={VEL 2.0,ACC 100.0}\r\nENDDAT",
        ),
        (".src", r"END\r\n$", "END"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n$TIMER[1]=0\r\n$timer_stop[ 1 ] = false\r\n"),
        (".src", r"(WAIT SEC 0\.100\r\n)", r"\1$TIMER_STOP[2]=TRUE\r\n"),
        (".src", r"(\$BASE=.*\r\n)", r"\1$TIMER[1]=0\r\n"),
    ],
    "rapid": [
        (".mod", "MODULE cut_one", "%%%\n  VERSION:1\n  LANGUAGE:ENGLISH\n%%%\nMODULE cut_one"),
        (".mod", r"PROC one\(\)", "proc ONE ( )"),
        (".mod", r"SetDO x3,1;", "SetDO  x3 , 1 ;"),
        (".mod", r"SetDO x3,1;", "setdo X3,1;"),
        (".mod", r"WaitTime 0\.100;", "WaitTime 0.1;"),
        (".mod", r"WaitTime 0\.100;", "WaitTime .1; ! pierce"),
        (".mod", r"MoveL \[\[", "MoveL  [ ["),
        (".mod", r"(MoveL .*;)", r"\1 ! the first corner, für J. Müller"),
        (".mod", r"PROC one\(\)\n", 'PROC one()\n    TPWrite "contour one";\n'),
        (".mod", r"PROC one\(\)\n", "PROC one()\n\n\n    ! remark\n"),
        (".mod", r"    SetDO x3,1;\n", "\tSetDO x3,1;\n"),
        (".mod", r"\[-1,\[0,0,0\],\[1,0,0,0\],0,0,0\]", "[12,[10,0,90],[1,0,0,0],0.1,0.1,0.1]"),
        (".mod", r"\[-1,\[0,0,0\],\[1,0,0,0\],0,0,0\]", "[6E1,[10,0,90],[1,0,0,0],.1,-.1,0.1]"),
        (".mod", r"\[TRUE", "[True"),
        (".mod", "9E9", "9E+09"),
        (".mod", r"ENDMODULE\n", "ENDMODULE"),
        (".mod", r"\n", "\r\n"),
        (".mod", r"PROC one\(\)\n", "PROC one()\n    ClkReset clock1;\n    ClkStart clock1;\n"),
    ],
    "fanuc": [
        ("ONE.ls", "MNEDITOR", "OPERATOR"),
        ("ONE.ls", 'COMMENT\t\t= "kerfpath"', 'COMMENT\t\t= "für Müller"'),
        ("ONE.ls", "DATE 00-01-01  TIME 00:00:00", "DATE 26-11-28  TIME 10:07:00"),
        ("ONE.ls", "PROG_SIZE\t= 0", "PROG_SIZE\t= 4711"),
        ("ONE.ls", r"J P\[1\]", "J P[1:over the corner]"),
        ("ONE.ls", r"P\[2\]\{", 'P[2:"corner"]{'),
        ("ONE.ls", r"DO\[3\]=ON", "DO[3:shutter]=ON"),
        ("ONE.ls", r"DI\[5\]=ON", "DI[5:source ready]=ON"),
        ("ONE.ls", r"WAIT    \.10\(sec\)", "WAIT   0.10(sec)"),
        ("ONE.ls", r"TB    \.20sec", "TB .20sec"),
        ("ONE.ls", r"/MN\r\n", "/APPL\r\n/MN\r\n"),
        ("ONE.ls", r"(CNT100)    ;", r"\1 ;"),
        ("ONE.ls", r"\r\n", "\n"),
        ("ONE.ls", r"(FINE) ( *;)", r"\1 ACC100\2"),
        ("ONE.ls", r"/MN\r\n", "/MN\r\n   1:  TIMER[1]=START ;\r\n"),
        ("ONE.ls", r"/MN\r\n", "/MN\r\n   1:  MESSAGE[contour one] ;\r\n"),
        ("ONE.ls", r"/MN\r\n", "/MN\r\n   1:   ;\r\n"),
        ("ONE.ls", r"/MN\r\n", "\r\n/MN\r\n"),
        ("ONE.ls", r"/PROG  ", "/PROG "),
        ("_OFF.ls", r"/POS\r\n", "   9:  ! that is all ;\r\n/POS\r\n"),
        ("ONE.ls", r"STACK_SIZE\t= 0", "STACK_SIZE\t= 500"),
    ],
    "inform": [
        ("ONE.JBI", "///DATE 2000/01/01 00:00", "///DATE 2026/11/28 10:07"),
        (
            "ONE.JBI",
            "///DATE 2000/01/01 00:00",
            "///COMM the first contour\r\n///DATE 2026/11/28 10:07",
        ),
        ("ONE.JBI", "SC,RW,RJ", "RW,SC,RJ"),
        ("ONE.JBI", r"///GROUP1 RB1\r\n", "///GROUP1 RB1\r\n///LVARS 0,0,0,0,0,0,0,0\r\n"),
        ("ONE.JBI", r"V=100\.0", "V=100"),
        ("ONE.JBI", r"(MOVL C00001.*PL=1)", r"\1 //the first corner"),
        ("ONE.JBI", r"NOP\r\n", "NOP\r\n'MSG for J. Müller\r\n"),
        ("ONE.JBI", r"MOVL C00001 V", "MOVL  C00001  V"),
        ("ONE.JBI", r"\r\n", "\n"),
        ("ONE.JBI", r"END\r\n$", "END"),
        ("ONE.JBI", r"NOP\r\n", 'NOP\r\nMSG "contour one"\r\n'),
        ("ONE.JBI", r"MOVL C00001 V", "\t MOVL C00001 V"),
        ("_OFF.JBI", r"END\r\n$", "'that is all\r\nEND\r\n"),
        ("ONE.JBI", r"(MOVL C00001.*PL=1)", r"\t \1 //the first corner"),
        ("ONE.JBI", r"(RCONF 1,0,0,0,0,0)(,0)*", r"\1"),
    ],
    "urscript": [
        (".script", r"def one\(\):", "def one ( ) :"),
        (".script", r"def one\(\):\n", "def one():\n\n    # remark\n"),
        (".script", r"    sleep\(0\.100\)", "\tsleep(0.1)"),
        (".script", r"(    movel\(.*\))", r"\1  # the first corner"),
        (".script", r"def one\(\):\n", 'def one():\n    textmsg("contour one")\n'),
        (".script", r"set_standard_digital_out\(3, True\)", "set_standard_digital_out( 3,True )"),
        (".script", r"end\n$", "end"),
        (".script", r"def one\(\):\n", "def one():\n    set_payload(12.5, [0, 0, 0.09])\n"),
        (".script", r"def one\(\):\n", "def one():\n    set_target_payload(.5,[0,0,.09])\n"),
        (".script", r"\n", "\r\n"),
        (".script", r"def one\(\):\n", '  $ 12 "contour one"\n  def one():\n'),
    ],
    "val3": [
        ("one.pgx", r"begin\n", "begin\n  // for J. Müller\n\n"),
        ("one.pgx", r"delay\(0\.100\)", "delay( 0.1 )"),
        ("one.pgx", r"(  movel\(pPath\[1\].*\))", r"\1 // the first corner"),
        ("one.pgx", r"doShutter=true", "doShutter = true"),
        ("one.pgx", r"\n", "\r\n"),
        ("one.pgx", r"begin\n", 'begin\n  logMsg("contour one")\n'),
        (".pjx", 'stackSize="5000"', 'stackSize="8000"'),
        (
            ".dtx",
            r"(?=</Datas>)",
            '<Data name="nTried" access="private" xsi:type="array" type="num" size="1">'
            '<Value key="0" value="3" /></Data>',
        ),
        ("one.pgx", r'name="one" access="public"', 'access="public" name="one"'),
    ],
}


@pytest.mark.parametrize(
    ("name", "number"), [(name, k) for name, edits in HARMLESS.items() for k in range(len(edits))]
)
def test_an_edit_without_effect_is_accepted(name, number):
    end, old, new = HARMLESS[name][number]
    files = files_of(name)
    (file, *_) = [f for f, text in files.items() if f.endswith(end) and re.search(old, text)]
    many = "\\n" in (old, old[-2:]) and old in (r"\n", r"\r\n")
    text = re.sub(old, new, files[file], count=0 if many else 1)
    if name == "fanuc":
        text = renumbered(text)
    assert text != files[file] or old == new
    assert why_refused(files | {file: text}, name) == ""


def test_lines_of_a_listing_are_all_numbered_or_none_is():
    files = files_of("fanuc")
    text = files["ONE.ls"]
    blank = re.sub(r"(?m)^ *\d+:", "    :", text)
    assert why_refused(files | {"ONE.ls": blank}, "fanuc") == ""
    one = text.replace("   3:", "    :", 1)
    assert "all lines to be numbered, or none" in why_refused(files | {"ONE.ls": one}, "fanuc")


def test_a_payload_schedule_is_known_by_the_settings():
    files = files_of("fanuc")
    text = renumbered(files["ONE.ls"].replace("/MN\r\n", "/MN\r\n   1:  PAYLOAD[2:head] ;\r\n"))
    known = settings("fanuc").model_copy(update={"payload_schedule": 2})
    assert refusal(files | {"ONE.ls": text}, "fanuc", made_of("fanuc"), known) == ""
    why = "ONE.ls, line 22: it is not known what PAYLOAD[2] holds; name the schedule"
    assert why_refused(files | {"ONE.ls": text}, "fanuc").startswith(why)


@pytest.mark.parametrize(("mass", "accepted"), [(3.0, True), (3.1, False)])
def test_a_load_is_at_most_that_of_the_job(mass, accepted):
    name, arm = "urscript", made_of("urscript").robot
    load = Load(mass=3.0, centre=np.array([0, 0, 0.09]))
    loaded = replace(arm, dynamics=replace(arm.dynamics, load=load))
    made = replace(made_of(name), robot=loaded)
    text = files_of(name)["cut_one.script"]
    text = text.replace("def one():\n", f"def one():\n    set_payload({mass})\n")
    found = refusal({"cut_one.script": text}, name, made, settings(name))
    assert accepted == (found == "")
    assert accepted or "a load up to 3 kg, mass_kg of [tool], got 3.1 kg" in found


HARMFUL = {
    "krl": [
        (".src", r"\$OUT\[1\]=FALSE\r\n", ";$OUT[1]=FALSE\r\n"),
        (".src", r"(TRIGGER .* DO \$OUT\[1\]=FALSE)", r"; \1"),
        (".src", r"\$OUT\[4\]=FALSE\r\n\$OUT\[3\]", "; x $OUT[4]=FALSE\r\n$OUT[3]"),
        (".src", r"(LIN \{.*\})\r", r"\1 $OUT[1]=TRUE\r"),
        (".src", r"WAIT SEC 0\.100", "WAIT SEC 0.1.00"),
        (".src", r"WAIT SEC 0\.100", "WAITSEC 0.100"),
        (".src", r"WAIT SEC 0\.100", "WAIT SEC 0. 100"),
        (".src", r"WAIT SEC 0\.100", "WAIT SEC.100"),
        (".src", r"HALT", "HA LT"),
        (".src", r"FALSE\r\nEND\r\n", "FAL\u017fE\r\nEND\r\n"),
        (".src", r"HALT", "\uff28ALT"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n&$OUT[1]=TRUE\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n$LOAD={M 1} $OUT[1]=TRUE\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n$LOAD=LOAD_DATA[1]\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n$LOAD={M 1} $BASE={X 1}\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n$LOAD={M 1,CM {X $OUT[1]=TRUE}}\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n$LOAD={M 17}\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n&REL 4\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\nDECL FDAT FP1={TOOL_NO 2}\r\n"),
        (".dat", r"ENDDAT", "DECL FDAT FP1={TOOL_NO 2} $OUT[1]=TRUE {}\r\nENDDAT"),
        (".src", r"(\$OUT\[1\]=FALSE)", " " * 250 + r"\1"),
        (".src", r"(LIN .* C_DIS\r\n)", r"\1$TIMER_STOP[1]=FALSE\r\n"),
        (".src", r"(TRIGGER .*\r\n)", r"\1$TIMER[1]=0\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n$TIMER_STOP[20]=FALSE\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\n$TIMER[1]=-5\r\n"),
        (".src", r"DEF one\(\)\r\n", "DEF one()\r\nWAIT FOR $TIMER_FLAG[1]\r\n"),
    ],
    "rapid": [
        (".mod", r"    SetDO x4,0;\n", "!   SetDO x4,0;\n"),
        (".mod", r"    SetDO x4,0;\n", '    TPWrite "SetDO x4,0;";\n'),
        (".mod", r"(MoveL .*);", r"\1;SetDO x1,1;"),
        (".mod", r"(MoveL .*);", r"\1 ! ;"),
        (".mod", r"PROC one\(\)\n", 'PROC one()\n    TPWrite "a" SetDO x1,1;\n'),
        (".mod", r"PROC one\(\)\n", 'PROC one()\n    TPWrite "a";SetDO x1,1;TPWrite "b";\n'),
        (".mod", r"(SetDO x4,0;)", r'\1 " ! x'),
        (".mod", r"PROC one\(\)\n", 'PROC one()\n    TPWrite "a\\\\22;SetDO x1,1;";\n'),
        (".mod", r"PROC one\(\)\n", "PROC one()\n%%%\n"),
        (".mod", r"\[-1,\[0,0,0\],\[1,0,0,0\],0,0,0\]", "[61,[10,0,90],[1,0,0,0],0,0,0]"),
        (".mod", r"\[-1,\[0,0,0\],\[1,0,0,0\],0,0,0\]", "[NaN,[10,0,90],[1,0,0,0],0,0,0]"),
        (".mod", r"\[-1,\[0,0,0\],\[1,0,0,0\],0,0,0\]", "[" * 1500),
        (".mod", r"WaitTime 0\.100;", "WaitTime 0.100"),
        (".mod", r"WaitTime 0\.100;", "Wait Time 0.100;"),
        (".mod", r"PROC one\(\)\n", "PROC one()\n    WaitUntil ClkRead(clock1)>5;\n"),
        (".mod", r"SetDO x3,1;", "SetDO x\u0663,1;"),
        (".mod", r"PROC main\(\)", "PROC TPWrite(string x)\n SetDO x1,1;\n ENDPROC\n PROC main()"),
    ],
    "fanuc": [
        ("ONE.ls", r":  DO\[1\]=OFF", ":  !DO[1]=OFF"),
        ("ONE.ls", r":  DO\[1\]=OFF", "://DO[1]=OFF"),
        ("ONE.ls", r":  DO\[1\]=OFF", ":  ! x ; DO[1]=OFF"),
        ("ONE.ls", r"DO\[1\]=OFF", "DO[1:off]=ON"),
        ("ONE.ls", r"DO\[3\]=ON", "DO[3:x]=ON,DO[1]=ON"),
        ("ONE.ls", r"DO\[3\]=ON", "DO[4:3]=ON"),
        ("ONE.ls", r"P\[2\]\{", "P[3:2]{"),
        ("ONE.ls", r"(CNT100)( *;)", r"\1 ACC50\2"),
        ("ONE.ls", r"(CNT100)( *;)", r"\1 Skip,LBL[1]\2"),
        ("ONE.ls", r"/MN\r\n", "/MN\r\n   1:  PAYLOAD[1] ;\r\n"),
        ("ONE.ls", r"/MN\r\n", "/MN\r\n   1:  MESSAGE[a],DO[1]=ON ;\r\n"),
        ("ONE.ls", r"/MN\r\n", "/MN\r\n   1:  MESSAGE[a],DO[1]=DI[2] ;\r\n"),
        ("ONE.ls", r"/MN\r\n", "/APPL\r\n  AUTO_SINGULARITY_HEADER;\r\n/MN\r\n"),
        ("ONE.ls", r"/MN\r\n", "/MN\r\n   1:  WAIT TIMER[1]>5 ;\r\n"),
        ("ONE.ls", "TASK_PRIORITY\t= 50", "TASK_PRIORITY\t= 90"),
        ("ONE.ls", "PAUSE_REQUEST\t= 0", "PAUSE_REQUEST\t= 7"),
        ("ONE.ls", r"PROG_SIZE\t", "PROG_SIZE\u00a0"),
        ("ONE.ls", r"L P\[2\]", "L P[\u0662]"),
        ("ONE.ls", r"(UF : )1", "\\g<1>\u0661"),
        ("ONE.ls", r"(TB +\.20sec,DO\[2\]=ON *;)", "\\1\u3000"),
    ],
    "inform": [
        ("ONE.JBI", r"DOUT OT#\(1\) OFF", "COMM DOUT OT#(1) OFF"),
        ("ONE.JBI", r"DOUT OT#\(1\) OFF", "EDTLCK COMM DOUT OT#(1) OFF"),
        ("ONE.JBI", r"DOUT OT#\(1\) OFF", "'DOUT OT#(1) OFF"),
        ("ONE.JBI", r"DOUT OT#\(1\) OFF", "//DOUT OT#(1) OFF"),
        ("ONE.JBI", r"(MOVL C00001.*PL=1)", r"\1 NWAIT"),
        ("ONE.JBI", r"(MOVL C00001.*)PL=1", r"\1//PL=1"),
        ("ONE.JBI", r"NOP\r\n", 'NOP\r\nMSG "a" DOUT OT#(1) ON\r\n'),
        ("ONE.JBI", "///DATE 2000/01/01 00:00", "///DATE 2026/11/28 10:07,DOUT"),
        ("ONE.JBI", "SC,RW,RJ", "SC,RW"),
        ("ONE.JBI", "RB1", "RB2"),
    ],
    "urscript": [
        (".script", r"    laser_set\(False\)", "#   laser_set(False)"),
        (".script", r"    laser_set\(False\)", '    textmsg("laser_set(False)")'),
        (".script", r"(    movel\(.*\))", r"\1; set_standard_digital_out(1, True)"),
        (".script", r"def one\(\):\n", 'def one():\n    textmsg("a", laser_set(True))\n'),
        (".script", r"sleep\(0\.100\)", "sle ep(0.100)"),
        (".script", r"def one\(\):\n", "def one():\n    set_payload(13.0)\n"),
        (".script", r"def one\(\):\n", "def one():\n    set_payload(load_mass)\n"),
        (".script", r"kill laser_run", "kill  gas_run"),
    ],
    "val3": [
        ("one.pgx", r"  dioLaser=false", "  //dioLaser=false"),
        ("one.pgx", r"  dioLaser=false", '  logMsg("dioLaser=false")'),
        ("one.pgx", r"begin\n", 'begin\n  logMsg("a") dioLaser=true\n'),
        ("one.pgx", r"  waitEndMove\(\)", "  // waitEndMove()"),
        ("one.pgx", r"DioLaser|dioLaser=(true|dioGas[^\n]*)", "diolaser=true"),
        (".pjx", 'stackSize="5000"', 'stackSize="50"'),
        (
            ".dtx",
            r"(?=</Datas>)",
            '<Data name="dioOther" access="private" xsi:type="array" type="dio" size="1">'
            '<Value key="0" link="BasicIO-1" /></Data>',
        ),
        (".pjx", 'stackSize="5000"', 'stackSize="\u0668\u0660\u0660\u0660"'),
    ],
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "number"), [(name, k) for name, edits in HARMFUL.items() for k in range(len(edits))]
)
def test_an_edit_beside_a_harmless_one_is_refused(name, number):
    end, old, new = HARMFUL[name][number]
    files = files_of(name)
    (file, *_) = [
        f for f, text in reversed(files.items()) if f.endswith(end) and re.search(old, text)
    ]
    text = re.sub(old, new, files[file], count=1)
    if name == "fanuc":
        text = renumbered(text)
    assert text != files[file]
    assert why_refused(files | {file: text}, name)


def test_every_harmless_line_is_an_example_of_its_kind():
    for name, known in HARMLESS_LINES.items():
        for each in known:
            line = each.example.partition(":")[2].strip(" ;") if name == "fanuc" else each.example
            line = each.example.removesuffix(" ;") if "[" in each.example else line
            assert LinePattern(each.pattern).fullmatch(compact(line)), each


def test_blanks_go_where_no_words_meet():
    assert compact("  WAIT   FOR  $IN [ 5 ]\t") == "WAIT FOR$IN[5]"
    assert compact('TPWrite  "a  b , c" ;') == 'TPWrite"a  b , c";'
    assert without_remark('a "x ; y" ; z', ";") == 'a "x ; y" '
    assert without_remark('a "x ; y', ";") == 'a "x ; y'
    for line in ("LIN {X 1.0}", "LIN{X 1.0}", "LIN { X  1.0 }"):
        assert LinePattern(r"LIN \{X (\S+)\}").fullmatch(line)
    for line in ("L IN {X 1.0}", "LIN{X1.0}"):
        assert not LinePattern(r"LIN \{X (\S+)\}").fullmatch(line)


def test_files_may_have_capitals_and_the_umlauts_of_a_pendant(tmp_path):
    for file, text in files_of("krl").items():
        edited = text.replace("\r\n", "\r\n; f\u00fcr M\u00fcller\r\n", 1)
        (tmp_path / file.upper()).write_bytes(edited.encode("cp1252"))
    assert why_refused(folder(tmp_path, "krl"), "krl", main="CUT_ONE.SRC") == ""


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "cp932"])
def test_remarks_of_a_job_are_in_the_encoding_of_its_pendant(tmp_path, encoding):
    remark = "\u30bd\u8868" if encoding == "cp932" else "f\u00fcr"  # 5C is a byte of the first two
    for file, text in files_of("inform").items():
        (tmp_path / file).write_bytes(text.replace("NOP", f"NOP\r\n'{remark}", 1).encode(encoding))
    assert why_refused(folder(tmp_path, "inform"), "inform", main="CUT_ONE.JBI") == ""


def test_text_in_another_encoding_is_refused_plainly(tmp_path):
    path, files = tmp_path / "a.src", folder(tmp_path, "krl")
    for encoding in ("utf-16", "utf-16-le", "utf-16-be", "utf-32"):
        path.write_bytes("DEF a()".encode(encoding))
        found = f"{path}: expected utf-8 or cp1252, got UTF-16; save it as UTF-8"
        assert why_refused(files, "krl", main="a.src") == found
    (tmp_path / "\u212a.src").write_bytes(b"")
    assert "the file 'K.src' is missing" in why_refused(files, "krl", main="K.src")
    path.write_bytes(b"DEF a() ; \x81")
    assert "a.src: expected text in utf-8 or cp1252" in why_refused(files, "krl", main="a.src")
