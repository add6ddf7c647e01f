MODULE cut_skin_outer
  ! Written by kerfpath for IRB 4600-60/2.05 (abb_irb4600_60_205).
  ! Complete the load of the tool: mass -1 stands for not known.
  ! The work object is the part in the robot's base, which is the world's, too.
  ! Transfer moves have not been checked for collisions.
  ! switchOff is for the events STOP and QSTOP: enter it there. A stop switches
  ! the laser off only then; the safety circuit of the cell has to, too.
  ! To begin at a contour, set nFirst to its number and move PP to Main.
  PERS tooldata tLaser:=[TRUE,[[51.3000,0.0000,248.7000],[0.95371695,0.00000000,0.30070580,0.00000000]],[-1,[0,0,0],[1,0,0,0],0,0,0]];
  PERS wobjdata wPart:=[FALSE,TRUE,"",[[1053.7000,-151.1000,612.3000],[0.96327561,-0.00981749,0.02988342,0.26666588]],[[0,0,0],[1,0,0,0]]];
  CONST speeddata vAir:=[100.00,50,5000,1000];
  CONST speeddata vApproach:=[100.00,500,5000,1000];
  CONST speeddata vCut:=[120.00,500,5000,1000];
  CONST zonedata zCorner:=[FALSE,0.300,0.300,0.300,0.030,0.300,0.030];
  VAR triggdata trOn;
  VAR triggdata trOff;
  PERS num nFirst:=1;

  PROC main()
    ConfL\Off;
    ConfJ\Off;
    SingArea\Off;
    PDispOff;
    EOffsOff;
    VelSet 100,vmax.v_tcp;
    SpeedRefresh 100;
    AccSet 100,100;
    PathAccLim FALSE,FALSE;
    WorldAccLim \Off;
    SoftDeact;
    switchOff;
    TriggIO trOn,0.0200\Time\DOp:=doLaser,1;
    TriggIO trOff,0.0200\Time\DOp:=doLaser,0;
    IF nFirst<=1 skin_outer;
    nFirst:=1;
  ERROR
    switchOff;
    StopMove;
    RAISE;
  UNDO
    switchOff;
  ENDPROC

  PROC switchOff()
    SetDO doLaser,0;
  ENDPROC

  PROC skin_outer()
    ! skin/outer: 8 nodes, 155.7 mm, posture front/up/plus
    MoveAbsJ [[7.066775,3.782389,31.404811,-47.828333,59.983773,74.111224],[9E9,9E9,9E9,9E9,9E9,9E9]],vAir,fine,tLaser\WObj:=wPart;
    TriggL [[85.3638,17.3041,10.1516],[0.10406266,-0.62299209,-0.76483670,0.12679368],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],vApproach,trOn,fine,tLaser\WObj:=wPart;
    MoveL [[78.7485,37.2152,2.9996],[0.08620855,-0.53724360,-0.82732339,0.13954716],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],vCut,zCorner,tLaser\WObj:=wPart;
    MoveL [[67.8636,54.5975,-5.4788],[0.07272096,-0.41479208,-0.89500951,0.14702778],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],vCut,zCorner,tLaser\WObj:=wPart;
    MoveL [[52.5638,69.4502,-11.4541],[0.06155370,-0.25664276,-0.95248582,0.15204076],[0,-1,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],vCut,zCorner,tLaser\WObj:=wPart;
    MoveL [[33.4066,80.4380,-11.3760],[0.04848868,-0.09213627,-0.98214340,0.15669746],[-1,-1,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],vCut,zCorner,tLaser\WObj:=wPart;
    MoveL [[12.8876,86.1410,-5.3004],[0.03184498,0.04622218,-0.98537199,0.16090818],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],vCut,zCorner,tLaser\WObj:=wPart;
    MoveL [[-7.6074,86.7665,3.1899],[0.01094957,0.15156504,-0.97474240,0.16366247],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]],vCut,zCorner,tLaser\WObj:=wPart;
    TriggL [[-28.1585,82.4227,10.2670],[-0.02729251,0.15914511,-0.97353334,0.16174299],[-1,0,-2,0],[9E9,9E9,9E9,9E9,9E9,9E9]],vCut,trOff,fine,tLaser\WObj:=wPart;
    MoveL [[-33.3896,97.7346,57.5764],[-0.02729251,0.15914511,-0.97353334,0.16174299],[-1,0,-2,0],[9E9,9E9,9E9,9E9,9E9,9E9]],vApproach,fine,tLaser\WObj:=wPart;
  ENDPROC
ENDMODULE
