/PROG  CUT_SKIN_OUTER
/ATTR
OWNER		= MNEDITOR;
COMMENT		= "kerfpath";
PROG_SIZE	= 0;
FILE_NAME	= ;
VERSION		= 0;
LINE_COUNT	= 26;
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
   3:  ! Moves through the air: not ;
   4:  ! checked for collisions. ;
   5:  ! A stop does not switch the ;
   6:  ! laser off: the cell's safety ;
   7:  ! has to. ;
   8:  ! Enter these frames (mm, deg). ;
   9:  ! World: on J1, at the height of ;
  10:  ! J2. ;
  11:  !UFRAME 1 X 1053.7000 ;
  12:  !UFRAME 1 Y -151.1000 ;
  13:  !UFRAME 1 Z 187.3000 ;
  14:  !UFRAME 1 W -0.170857 ;
  15:  !UFRAME 1 P 3.600998 ;
  16:  !UFRAME 1 R 30.942252 ;
  17:  !UTOOL 1 X 51.3000 ;
  18:  !UTOOL 1 Y 0.0000 ;
  19:  !UTOOL 1 Z 248.7000 ;
  20:  !UTOOL 1 W 0.000000 ;
  21:  !UTOOL 1 P 35.000000 ;
  22:  !UTOOL 1 R 0.000000 ;
  23:  UFRAME_NUM=1 ;
  24:  UTOOL_NUM=1 ;
  25:  DO[1]=OFF ;
  26:  CALL SKIN_OUTER    ;
/POS
/END
