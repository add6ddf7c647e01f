/PROG  CUT_SKIN_OUTER
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "kerfpath";
PROG_SIZE	= 0;
CREATE		= DATE 00-01-01  TIME 00:00:00;
MODIFIED	= DATE 00-01-01  TIME 00:00:00;
FILE_NAME	= ;
VERSION		= 0;
LINE_COUNT	= 28;
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
   1:  ! kerfpath, for M-20iD/25 = ;
   2:  ! M-20/25-18D ;
   3:  ! Transfer moves: not checked for ;
   4:  ! collisions. ;
   5:  ! CUT_SKIN_OUTER_OFF as BG logic ;
   6:  ! switches off at a stop. ;
   7:  ! The cell's safety has to switch ;
   8:  ! the laser off, too. ;
   9:  ! Enter these frames (mm, deg). ;
  10:  ! World: on J1, at the height of ;
  11:  ! J2. ;
  12:  !UFRAME 1 X 1053.7000 ;
  13:  !UFRAME 1 Y -151.1000 ;
  14:  !UFRAME 1 Z 187.3000 ;
  15:  !UFRAME 1 W -0.170857 ;
  16:  !UFRAME 1 P 3.600998 ;
  17:  !UFRAME 1 R 30.942252 ;
  18:  !UTOOL 1 X 51.3000 ;
  19:  !UTOOL 1 Y 0.0000 ;
  20:  !UTOOL 1 Z 248.7000 ;
  21:  !UTOOL 1 W 0.000000 ;
  22:  !UTOOL 1 P 35.000000 ;
  23:  !UTOOL 1 R 0.000000 ;
  24:  UFRAME_NUM=1 ;
  25:  UTOOL_NUM=1 ;
  26:  OVERRIDE=100% ;
  27:  DO[1]=OFF ;
  28:  CALL SKIN_OUTER    ;
/POS
/END
