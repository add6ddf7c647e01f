/PROG  SKIN_OUTER
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "kerfpath";
PROG_SIZE	= 0;
CREATE		= DATE 00-01-01  TIME 00:00:00;
MODIFIED	= DATE 00-01-01  TIME 00:00:00;
FILE_NAME	= ;
VERSION		= 0;
LINE_COUNT	= 14;
MEMORY_SIZE	= 0;
PROTECT		= READ_WRITE;
TCD:  STACK_SIZE	= 0,
      TASK_PRIORITY	= 50,
      TIME_SLICE	= 0,
      BUSY_LAMP_OFF	= 0,
      ABORT_REQUEST	= 0,
      PAUSE_REQUEST	= 0;
DEFAULT_GROUP	= 1,*,*,*,*;
CONTROL_CODE	= 00000000 00000000;
/MN
   1:  UFRAME_NUM=1 ;
   2:  UTOOL_NUM=1 ;
   3:  ! skin/outer: 8 nodes, 155.7 mm, ;
   4:  ! posture front/up/plus ;
   5:J P[1] 10% FINE    ;
   6:L P[2] 600cm/min FINE TB    .02sec,DO[1]=ON    ;
   7:L P[3] 720cm/min CNT100    ;
   8:L P[4] 720cm/min CNT100    ;
   9:L P[5] 720cm/min CNT100    ;
  10:L P[6] 720cm/min CNT100    ;
  11:L P[7] 720cm/min CNT100    ;
  12:L P[8] 720cm/min CNT100    ;
  13:L P[9] 720cm/min FINE TB    .02sec,DO[1]=OFF    ;
  14:L P[10] 600cm/min FINE    ;
/POS
P[1]{
   GP1:
	UF : 1, UT : 1,	
	J1=    5.5939 deg,	J2=   12.5289 deg,	J3=  -32.4747 deg,
	J4=   47.0465 deg,	J5=  -60.9174 deg,	J6=  109.1367 deg
};
P[2]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =   85.3638  mm,	Y =   17.3041  mm,	Z =   10.1516  mm,
	W = -161.1184 deg,	P =   -0.0687 deg,	R =  101.6600 deg
};
P[3]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =   78.7485  mm,	Y =   37.2152  mm,	Z =    2.9996  mm,
	W = -161.1229 deg,	P =    0.4181 deg,	R =  114.0721 deg
};
P[4]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =   67.8636  mm,	Y =   54.5975  mm,	Z =   -5.4788  mm,
	W = -161.1240 deg,	P =   -0.4698 deg,	R =  130.1912 deg
};
P[5]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 0',
	X =   52.5638  mm,	Y =   69.4502  mm,	Z =  -11.4541  mm,
	W = -161.2478 deg,	P =   -2.2476 deg,	R =  149.4689 deg
};
P[6]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 1',
	X =   33.4066  mm,	Y =   80.4380  mm,	Z =  -11.3760  mm,
	W = -161.4922 deg,	P =   -3.8056 deg,	R =  168.6611 deg
};
P[7]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 1',
	X =   12.8876  mm,	Y =   86.1410  mm,	Z =   -5.3004  mm,
	W = -161.6322 deg,	P =   -4.4525 deg,	R = -175.3489 deg
};
P[8]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 1',
	X =   -7.6074  mm,	Y =   86.7665  mm,	Z =    3.1899  mm,
	W = -161.5464 deg,	P =   -4.0690 deg,	R = -162.9847 deg
};
P[9]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 1',
	X =  -28.1585  mm,	Y =   82.4227  mm,	Z =   10.2670  mm,
	W = -161.1185 deg,	P =    0.0951 deg,	R = -161.4160 deg
};
P[10]{
   GP1:
	UF : 1, UT : 1,		CONFIG : 'N U T, 0, 0, 1',
	X =  -33.3896  mm,	Y =   97.7346  mm,	Z =   57.5764  mm,
	W = -161.1185 deg,	P =    0.0951 deg,	R = -161.4160 deg
};
/END
