<?xml version="1.0" encoding="utf-8"?>
<!DOCTYPE TS>
<TS version="2.1" sourcelanguage="en">
  <context>
    <name>kerfpath</name>
    <message>
      <source>Kerfpath</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Installing kerfpath; this takes some minutes. A message says when it is done.</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Install kerfpath</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>nothing to cut is picked: pick edges or faces of the part first</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Kerfpath: Fixtures</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>edges of one part are cut at a time, got those of </source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>select solids other than the part first</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>kerfpath is installed; go on</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>the job of this document cuts {}, picked is {}; pick an edge of the first, or delete the job</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Cut what is picked</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Cut the loops of the picked edges or faces: plans at once, and shows the panel</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Cut these edges only</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Cut the picked edges from end to end; a face that is picked, too, says from which side</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Do not cut</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Take the selected contours out of the job</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Keep clear of it</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>The selected solids become fixtures, or no fixtures any more: the plan avoids collisions</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Plan and play</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Show the panel of the job: plan, play, settings, program</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Write the program</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Write the audited program, the job and the drawing</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>it is gone</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>several edges are as it was</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>no edge is as it was</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>only {:.4g} of the {:.4g} mm of loop {} are edges of the model; pick another one</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>it is now a {}</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>the model has changed: {} was a {}, {}, and {}; pick the contour again</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{} are a whole loop; take Cut what is picked</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{} is on no loop that can be cut from outside; pick an edge of the outer side of the part</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{} is on {}; pick the face whose edge is to be cut, or another edge of the loop, too</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{} meet at one point; cut one line at a time</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>no edge is picked: pick the edges of the line first</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{}: its side is not clear; pick the face from whose side it is cut, too, with Control held</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>the model has changed: the face on whose side {} is cut is another one; pick the line again</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Rotations about the beam along the cut: why they are lost, and the chosen one</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Cut</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>All settings</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Stop</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Change the job so that there is a path</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Choose the folder of the program</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Speed</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Head</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Language</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Folder of the program</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Robot</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Play</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Kerfpath: Folder</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Start</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>No verdict yet</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>see the audit</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Passed: {} audited</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Pause</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>kerfpath does not run</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>ready</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Plan</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>contour</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>contours</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>; at most {:.1f} % above the best motion</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Wrote {} to {}</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Of all contours</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>The lowest of the contours</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Not to be cut: {}</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>kerfpath is not found on PATH, in ~/.local/bin or in the workbench's own environment; install it with the button, or run `kerfpath freecad` in the environment that has it</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>the preference of the workbench names</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>the variable KERFPATH names</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>`kerfpath freecad` has written</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>it said nothing</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>to install kerfpath, uv or a Python of version {} or newer with venv is needed, and none is on PATH; install uv (https://docs.astral.sh/uv) and try again</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>kerfpath has ended: {}</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>this workbench belongs to kerfpath {}, and {} is {}; run `kerfpath freecad` in the environment that you want, which installs its workbench, and start FreeCAD again</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>there is no kerfpath at {}</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>the Python {} has no kerfpath; install it there</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{} has failed: {}</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>kerfpath has refused the connection: {}</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{} cannot be started ({})</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>kerfpath does not answer ({})</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{}, which {}; correct it</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>starting kerfpath</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>a job needs a contour: pick another one before, or delete the job</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Remove contours</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Change the job</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Kerfpath: Cut</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>the drawing is not read yet; wait until it is, and remove the contour then</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>Robot {}</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{} is already cut; pick another loop</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>the drawing has no loop {} any more</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{} is already cut</source>
      <translation type="unfinished" />
    </message>
    <message>
      <source>{} cannot be written ({}); choose another folder</source>
      <translation type="unfinished" />
    </message>
  </context>
</TS>
