"""Robot programs of others in plain styles, one path in each language; and data beside one."""

KRL = """\
&ACCESS RVO1
DEF trim( )
;FOLD INI
BAS (#INITMOV,0 )
;ENDFOLD (INI)
$TOOL=TOOL_DATA[2]
$BASE={X 800,Y 0,Z 400,A 0,B 0,C 0}
PTP {A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}
PTP {X 0,Y 0,Z 50,A 0,B 0,C 180}
LIN {X 0,Y 0,Z 0,A 0,B 0,C 180}
$OUT[5]=TRUE
WAIT SEC 0.2
$VEL.CP=0.05
LIN {X 10} C_DIS
LIN XP2 C_DIS ; the corner
LIN {X 0,Y 20,Z 0,A 0,B 0,C 170}
$OUT[5]=FALSE
$VEL.CP=1
LIN {Z 50}
PTP HOME
END
"""
KRL_DATA = """\
DEFDAT TRIM
DECL E6POS XP2={X 10.0,Y 20.0,Z 0.0,A 0.0,B 0.0,C 170.0,S 2,T 35,E1 0.0}
ENDDAT
"""
RAPID = """\
MODULE Trim
  PERS tooldata tBeam:=[TRUE,[[0,0,250],[1,0,0,0]],[12,[0,0,100],[1,0,0,0],0,0,0]];
  PERS wobjdata wFix:=[FALSE,TRUE,"",[[800,0,400],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
  CONST robtarget p1:=[[0,0,0],[0,1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget p2:=[[10,20,0],[0,0.9961947,0,0.0871557],[0,0,0,0],
    [9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST robtarget p3:=[[0,20,0],[0,0.9961947,0,0.0871557],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
  CONST speeddata vBeam:=[50,500,5000,1000];
  PROC main()
    ! the corner of a flange; "p2" leans
    TPWrite "trim; begins";
    MoveJ Offs(p1,0,0,50),v500,z50,tBeam\\WObj:=wFix;
    MoveL p1,v100,fine,tBeam\\WObj:=wFix;
    Set doBeam;
    MoveL Offs(p1,10,0,0),vBeam,z1,tBeam\\WObj:=wFix;
    Side;
    Reset doBeam;
    MoveL RelTool(p3,0,0,-50),v100,fine,tBeam\\WObj:=wFix;
  ENDPROC
  PROC Side()
    MoveL p2,vBeam,z1,tBeam\\WObj:=wFix;
    MoveL p3,vBeam,fine,tBeam\\WObj:=wFix;
  ENDPROC
ENDMODULE
"""
LISTING = """\
/PROG  TRIM
/ATTR
OWNER		= MNEDITOR;
/MN
   1:  !trim of a flange ;
   2:  UFRAME_NUM=2 ;
   3:  UTOOL_NUM=1 ;
   4:J PR[1:HOME] 20% FINE    ;
   5:J P[1] 20% FINE    ;
   6:L P[2:begin] 100mm/sec FINE    ;
   7:  DO[5:beam]=ON ;
   8:L P[3] 50mm/sec CNT50    ;
   9:L P[4] 50mm/sec CNT50    ;
  10:L P[5] 50mm/sec FINE TB .02sec,DO[5]=OFF    ;
  11:L P[6] 100mm/sec FINE    ;
/POS
"""
SCRIPT = """\
def trim():
  set_tcp(p[0, 0, 0.25, 0, 0, 0])
  global fixture = p[0.8, 0, 0.4, 0, 0, 0]
  corner = pose_trans(fixture, p[0.01, 0.02, 0, 3.12963795, 0, 0.27380783])
  movej([0, -1.57, 1.57, -1.57, -1.57, 0], a=1.4, v=1.05)
  movej(pose_trans(fixture, p[0, 0, 0.05, 3.14159265359, 0, 0]), 1.4, 1.05)
  movel(pose_trans(fixture, p[0, 0, 0, 3.14159265359, 0, 0]), 1.2, 0.1)
  set_digital_out(2, True)
  movel(pose_trans(fixture, p[0.01, 0, 0, 3.14159265359, 0, 0]), a=1.2, v=0.05, r=0.001)
  movel(corner, a=1.2, v=0.05, r=0.001)
  movel(pose_trans(fixture, p[0, 0.02, 0, 3.12963795, 0, 0.27380783]), a=1.2, v=0.05)
  set_digital_out(2, False)
  movel(pose_trans(fixture, p[0, 0.02, 0.05, 3.14159265359, 0, 0]), 1.2, 0.1)
end
"""
PLACES = [
    (0, 0, 50, 180, 0, 0), (0, 0, 0, 180, 0, 0), (10, 0, 0, 180, 0, 0), (10, 20, 0, 170, 0, 0),
    (0, 20, 0, 170, 0, 0), (0, 20, 50, 170, 0, 0),
]  # fmt: skip


def _listing() -> str:
    rows = []
    for n, (x, y, z, w, p, r) in enumerate(PLACES, 1):
        rows += [f"P[{n}]{{", "   GP1:", "\tUF : 2, UT : 1,\t\tCONFIG : 'N U T, 0, 0, 0',"]
        rows += [f"\tX = {x:8.3f}  mm,\tY = {y:8.3f}  mm,\tZ = {z:8.3f}  mm,"]
        rows += [f"\tW = {w:8.3f} deg,\tP = {p:8.3f} deg,\tR = {r:8.3f} deg", "};"]
    return LISTING + "\n".join([*rows, "/END", ""])


TEXTS = {
    "trim.src": KRL,
    "trim.dat": KRL_DATA,
    "trim.mod": RAPID,
    "trim.ls": _listing(),
    "trim.script": SCRIPT,
}
"""Texts by the names of their files."""
