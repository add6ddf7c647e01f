// The messages between server and page, made from kerfpath.studio.messages.

/** A contour of the job. */
export interface ContourName {
  name: string;
  /** Index of its table in `contour`; contours of a `pick_all` share it. */
  index: number;
}

/** An error in the job. */
export interface Fault {
  /** The key that it concerns, as a path; possibly empty. */
  key: (string | number)[];
  /** The line of the text, from 1 on; null if it concerns none. */
  line: number | null;
  message: string;
}

/** The current job. */
export interface JobMessage {
  type: "job";
  revision: number;
  /** Name of the file. */
  name: string;
  text: string;
  /** Its tables with every key and its default, in the units of their names; null if the text is not a valid job. */
  values: Record<string, any> | null;
  /** The dotted keys that are in the text, such as `contour.0.speed_m_min`. */
  given: string[];
  contours: ContourName[];
  /** Whether there is a step back; `redo`: a step forward. */
  undo: boolean;
  redo: boolean;
  /** Whether the file has this text. */
  saved: boolean;
  faults: Fault[];
  /** The weights (n, 1/rad or 1/m) that apply if the job has none. */
  weights: number[];
}

/** A key that is set and removed together with another one. */
export interface Companion {
  key: string;
  /** The value that it gets if it has none; null: it is only removed. */
  value: any;
}

/** A key of the job that has a control. */
export interface OptionField {
  /** Its dotted path; `contour.x` is x of the chosen contour's table. */
  key: string;
  label: string;
  kind: "number" | "choice" | "switch" | "table" | "list" | "joints";
  unit: string;
  choices: string[];
  default: any;
  /** The least value, if there is one. */
  low: number | null;
  /** The largest value, if there is one. */
  high: number | null;
  /** What it takes, in words. */
  help: string;
  /** A key without which this one has no meaning. */
  needs: string | null;
  /** Whether a job cannot be without it. */
  required: boolean;
  /** A table that requires this key and is removed with it. */
  table: string | null;
  companion: Companion | null;
}

/** Fields under one title. */
export interface OptionGroup {
  title: string;
  /** Whether they are keys of the chosen contour. */
  contour: boolean;
  fields: OptionField[];
}

/** One of the ways to place the nodes of a contour. */
export interface Sampling {
  label: string;
  /** Its required key, the first one of all. */
  field: OptionField;
  keys: string[];
  usual: number;
}

/** An offset of part, robot base or head that a search for the best placement may vary. */
export interface Variable {
  /** Its name in `[layout]`, in requests and in offsets. */
  key: string;
  label: string;
  unit: string;
  /** The least and the largest value of its usual range. */
  usual: number[];
  /** Whether it varies if the job has no range at all. */
  varies: boolean;
}

/** A robot of the library; `/robot/ID.svg` is its picture. */
export interface RobotChoice {
  id: string;
  maker: string;
  model: string;
  joints: number;
  kinematics: string;
  /** m */
  reach: number | null;
  /** kg */
  payload: number | null;
  /** The nearest ratio of acceleration to velocity, if its accelerations are not known. */
  ratio: string | null;
  /** What a job must give, as it is not known. */
  missing: string;
  /** Those of its controllers. */
  languages: string[];
}

/** The form of options of the job: which keys have a control, and what it must know of them. */
export interface OptionsMessage {
  type: "options";
  groups: OptionGroup[];
  samplings: Sampling[];
  /** The goals of a search for the best placement, in words. */
  goals: Record<string, string>;
  variables: Variable[];
  /** The criteria of a Pareto set. */
  criteria: string[];
  /** The languages of a program. */
  languages: string[];
  /** The library. */
  robots: RobotChoice[];
  /** The shipped heads. */
  heads: string[];
  /** Ends of the names of drawings that can be read, with their dots. */
  suffixes: string[];
  /** Units of a drawing. */
  units: string[];
  /** Ends of the names of files with a solid, as of a fixture, with their dots. */
  solids: string[];
  /** Units of a mesh in such a file. */
  solid_units: string[];
}

/** A joint of the robot, or an external axis. */
export interface JointEntry {
  name: string;
  /** Of its values. */
  unit: "rad" | "m";
  /** What an external axis moves; null for a joint of the arm. */
  carries: "robot" | "part" | null;
  /** Its frame at angle 0 in the frame of the previous joint; for the first joint and for external axes: in the base. */
  T: number[];
  /** A unit vector (3) in its own frame. */
  axis: number[];
  /** Null for endless joints, as `upper`. */
  lower: number | null;
  upper: number | null;
  endless: boolean;
  velocity: number;
  acceleration: number;
}

/** The chain of the robot, to the tip of its tool. */
export interface RobotEntry {
  id: string;
  /** Those of the arm, then the external axes. */
  joints: JointEntry[];
  /** In the last frame. */
  T_flange: number[];
  /** The tip in the flange. */
  T_tool: number[];
}

/** Joints, and the pose of the tip there in the room, to check the page's kinematics. */
export interface SampleEntry {
  q: number[];
  T: number[];
}

/** A body of the scene. */
export interface BodyEntry {
  name: string;
  kind: "robot" | "head" | "part" | "fixture" | "floor";
  /** Number of the frame that it moves with. */
  frame: number;
  /** An id for `/mesh/ID`, in coordinates of that frame. */
  mesh: string;
  /** Whether the shape replaces one that is not known. */
  approximate: boolean;
  /** In CSS notation; "": that of its kind. */
  colour: string;
}

/** A contour of the scene, as it is cut. */
export interface ContourEntry {
  name: string;
  /** As in `job`. */
  index: number;
  /** The name of its loop of the part. */
  loop: string;
  closed: boolean;
  /** (K 3) */
  points: number[];
  /** (K 3) */
  axes: number[];
  /** (K) m from its start. */
  s: number[];
  /** (K), as in trajectory.csv: `"cut"`, `"lead-in"`, ... */
  kind: string[];
  speed_m_min: number;
}

/** The robot, bodies and contours of the cell; only robot and head until the drawing is read. */
export interface SceneMessage {
  type: "scene";
  revision: number;
  robot: RobotEntry;
  sample: SampleEntry;
  bodies: BodyEntry[];
  /** Pose of the part in the base. */
  T_part: number[];
  contours: ContourEntry[];
  /** Whether the job has a `[cell]`, so that plans keep clear of these bodies. */
  cell: boolean;
}

/** A loop of the part, whether or not it is cut. */
export interface LoopEntry {
  name: string;
  face: string;
  /** `inner`: a hole. */
  kind: "outer" | "inner" | "open";
  /** Of a sheet. */
  side: "outer" | "inner" | "edge" | "blind" | "sunk" | "";
  /** False for a loop that cannot be cut because of its gap. */
  closed: boolean;
  /** m */
  length: number;
  /** m; null if it is not round. */
  diameter: number | null;
  /** m, the largest between two of its edges. */
  gap: number;
  /** (m 3), which repeat the first one at the end if it is drawn closed. */
  points: number[];
}

/** A run of triangles of the part's mesh. */
export interface FaceEntry {
  /** The face or skin that they belong to. */
  name: string;
  triangles: number;
}

/** The loops and faces of the drawing that can be picked. */
export interface PartMessage {
  type: "part";
  revision: number;
  /** Pose of the part in the base, in which the loops are given. */
  T: number[];
  loops: LoopEntry[];
  /** In the order of the mesh. */
  faces: FaceEntry[];
  /** The number of loops that are not sent: those of the pieces of skins, those around the thickness of a sheet, and those beyond the 3000 longest. */
  left_out: number;
}

/** The progress of the server's work. */
export interface ProgressMessage {
  type: "progress";
  /** Whether anything is being computed. */
  busy: boolean;
  /** The step. */
  label: string;
  done: number;
  /** 0 if the total is not known. */
  total: number;
}

/** The least value of a measure of comfort along a plan. */
export interface NearestEntry {
  name: string;
  value: number | null;
  unit: string;
  node: number;
}

/** The criteria of a plan: one number for each joint. */
export interface CriteriaEntry {
  displacement: number[];
  largest_increment: number[];
  range: number[];
  peak_velocity: number[];
  peak_acceleration: number[];
  nearest: NearestEntry[];
}

/** One line of the audit. */
export interface CheckEntry {
  code: string;
  title: string;
  value: number | null;
  limit: number | null;
  unit: string;
  level: string;
  ok: boolean;
  node: number | null;
}

/** The tool tip as the joints execute a plan, beside the path as drawn. */
export interface ExecutedEntry {
  /** (M 3) m, the points of the path that are nearest to the tip. */
  drawn: number[];
  /** (M 3) m, at instants that are evenly spread. */
  tip: number[];
  /** m, the largest distance of the two. */
  largest: number;
  /** How the joints follow what is commanded, and whether that is assumed, fitted or measured. */
  joints: string;
}

/** One motion along a contour, or along a piece of one. */
export interface PlanMessage {
  type: "plan";
  revision: number;
  contour: string;
  /** Of the plan, with a number for a piece of an interrupted cut. */
  name: string;
  /** The number of plans of the contour. */
  pieces: number;
  /** The id of its map. */
  graph: string;
  /** (K) m from the start of the contour. */
  s: number[];
  /** (K) */
  time: number[];
  /** (K n), endless joints not wrapped. */
  q: number[];
  /** (K) */
  gamma: number[];
  /** (K) */
  posture: number[];
  /** (K 3) */
  points: number[];
  /** (K), as in `scene`. */
  kind: string[];
  /** (K-1) m/s between nodes. */
  speed: number[];
  cost: number;
  /** Null while not known, as `gap`. */
  bound: number | null;
  /** A fraction. */
  gap: number | null;
  /** False while a bound is being computed. */
  settled: boolean;
  optimal: boolean;
  statement: string;
  /** Of the search. */
  method: string;
  /** (n) 1/rad or 1/m that were used. */
  weights: number[];
  previous_cost: number | null;
  criteria: CriteriaEntry;
  /** ((K-1) n), signed, of the limit of each joint. */
  velocity_share: number[];
  /** ((K-2) n), signed, of the limit of each joint. */
  acceleration_share: number[];
  /** (K), the largest share at each node. */
  joint_load: number[];
  /** The audit, null until it is complete. */
  checks: CheckEntry[] | null;
  /** Whether it passes; null until it is complete. */
  passed: boolean | null;
  /** Null until the audit is complete, and if the robot stops at every node. */
  executed: ExecutedEntry | null;
  /** In words. */
  feed: string | null;
  /** The time of the search. */
  seconds: number;
}

/** The distances of bodies in the `[cell]` along a plan, sent once all plans are found. Pairs with a near-miss distance of their own, such as the nozzle and the part, are left out: they are always near. */
export interface ClearanceMessage {
  type: "clearance";
  revision: number;
  contour: string;
  /** Of the plan. */
  name: string;
  /** (K) m of the nearest pair, negative if they overlap. */
  distance: (number | null)[];
  /** (K) m, the distance beyond the near-miss distance of that pair. */
  over: (number | null)[];
  /** (K), the index of that pair in `pairs`. */
  pair: number[];
  /** Two names of bodies each. */
  pairs: string[][];
}

/** A reason of loss. */
export interface LossEntry {
  name: string;
  count: number;
}

/** One key of the job and its new value. */
export interface EditEntry {
  path: (string | number)[];
  value: any;
}

/** A change that would make a path. */
export interface Relaxation {
  label: string;
  edits: EditEntry[];
}

/** Why a contour has no plan, and changes that would make a path. */
export interface NoPathMessage {
  type: "nopath";
  revision: number;
  contour: string;
  /** The last one that is reached; -1: none. */
  node: number;
  /** The first node from which the end is reached. */
  back: number | null;
  /** Of `node`. */
  s: number;
  /** (3) */
  point: number[];
  /** One line. */
  statement: string;
  /** Of the proof. */
  scope: "every gamma" | "grid" | "undecided";
  /** The reasons of loss there. */
  reasons: LossEntry[];
  graph: string;
  /** Null while they are being searched for. */
  relaxations: Relaxation[] | null;
  /** The same in words. */
  remedy: string;
}

/** A stretch of the program. */
export interface Segment {
  /** `move`: a transfer move. */
  kind: "move" | "approach" | "pierce" | "cut" | "retract";
  begin: number;
  end: number;
  /** Null for moves. */
  contour: string | null;
  /** For a cut, the name of its plan, whose `time` and `q` apply from `begin` on. */
  plan: string | null;
  /** (m), from `begin` on; null for a cut. */
  time: number[] | null;
  /** (m n), linear in between; null for a cut. */
  q: number[] | null;
}

/** The segments of the program in its order, on its clock. */
export interface ProgramMessage {
  type: "program";
  revision: number;
  /** s */
  total: number;
  /** Empty without a program; then `notes` has the reason. */
  segments: Segment[];
  /** Whether the moves are proved clear. */
  checked: boolean;
  /** Sentences. */
  notes: string[];
}

/** A file that can be exported, or why it cannot. */
export interface Export {
  name: string;
  about: string;
  href: string;
  ready: boolean;
  why: string;
  /** What `edits` do, in words. */
  remedy: string;
  /** Changes of the job that make it ready, as far as is known. */
  edits: EditEntry[];
}

/** The shares of a program's time, s. */
export interface Cycle {
  cutting: number;
  air: number;
  piercing: number;
  total: number;
}

/** The result of a run of the job, once it is complete. */
export interface OutcomeMessage {
  type: "outcome";
  revision: number;
  passed: boolean;
  exports: Export[];
  cycle: Cycle | null;
  /** Sentences. */
  notes: string[];
}

/** A quantity that the admitted poses of a map can be shaded by. */
export interface ShadeName {
  /** `clearance` (with a `[cell]`: the least distance of a pair beyond its near-miss distance, without pairs that have a distance of their own), a measure of `kerfpath.comfort`, or `turns`, the number of turns on which a pose is admitted. */
  by: string;
  words: string;
  /** `""`: a number. */
  unit: string;
}

/** The map of one posture. */
export interface CodeLayer {
  posture: number;
  name: string;
  /** Base64 of K m bytes, all gamma of a node in a row. */
  codes: string;
}

/** Gamma and posture of a plan along the map. */
export interface CourseEntry {
  name: string;
  s: number[];
  gamma: number[];
  posture: number[];
}

/** The map of a contour: the reason of loss of every pose. */
export interface MapMessage {
  type: "map";
  revision: number;
  contour: string;
  graph: string;
  /** (K) */
  s: number[];
  /** (m) ascending in (-pi, pi], evenly spaced except at the ends of windows. */
  gamma: number[];
  /** K */
  nodes: number;
  /** The words of the codes. */
  reasons: string[];
  /** For each code a word that decides its colour: `admitted`, `reach`, `joint`, `margin`, `cell`, `pinned`, `unwanted`, `other`. */
  kinds: string[];
  /** For each code its colour in the report, distinct for every type of colour vision. */
  colours: string[];
  layers: CodeLayer[];
  /** Sentences about the postures without a layer. */
  hidden: string[];
  /** A sentence on the external axes at its poses, `""` without any. */
  external: string;
  shades: ShadeName[];
  /** Of the plans. */
  course: CourseEntry[];
}

/** The values of a quantity over the map of one posture. */
export interface ShadeLayer {
  posture: number;
  /** Base64 of K m bytes like `codes`, from 0 for `low` to 253 for `high`; 254: bodies are closer than allowed, 255: no pose is admitted. Of several poses, on several turns or with several tilts, the highest value counts. */
  values: string;
  /** As many bytes, the index of the nearest pair in `pairs`, 255: none. */
  nearest: string | null;
}

/** A quantity at every admitted pose of a map. */
export interface ShadeMessage {
  type: "shade";
  revision: number;
  contour: string;
  /** Of that map. */
  graph: string;
  /** As in its `shades`. */
  by: string;
  words: string;
  unit: string;
  /** The end of the scale, in the unit. */
  low: number;
  /** The other end. */
  high: number;
  /** Whether values are lower bounds, sent up to `high` only. */
  beyond: boolean;
  layers: ShadeLayer[];
  /** Two names of bodies each. */
  pairs: string[][];
}

/** The course of another technique on the same layered graph. It has the metric, weights and limits of the job that the technique has. */
export interface TechniqueMessage {
  type: "technique";
  /** Of the plan that it is compared with. */
  revision: number;
  contour: string;
  method: "paper" | "known";
  /** As in `course`, with `gamma` and `posture`; empty if it finds no path. */
  s: number[];
  gamma: number[];
  posture: number[];
  cost: number | null;
  /** (n), shares of the limit of each joint. */
  peak_velocity: (number | null)[];
  /** (n) */
  peak_acceleration: (number | null)[];
  /** Its claim, or why there is no path. */
  statement: string;
  /** Sentences on the options of the job that it ignores. */
  notes: string[];
}

/** The joints at one place of the map. */
export interface PoseMessage {
  type: "pose";
  contour: string;
  node: number;
  gamma: number;
  posture: number;
  /** (n); null if the robot cannot reach the pose. */
  q: number[] | null;
  admitted: boolean;
  /** One line with numbers, and with the joints on each turn if there are several. */
  reason: string;
}

/** The fastest constant speed of a contour. */
export interface FastestMessage {
  type: "fastest";
  revision: number;
  contour: string;
  speed_m_min: number;
  on_grid_m_min: number | null;
  /** One line. */
  binds: string;
  edits: EditEntry[];
}

/** A file of the program. */
export interface FileEntry {
  name: string;
  text: string;
  /** The numbers, from 1 on, of its lines that move or wait; empty if the language is not read back. */
  lines: number[];
  /** Their times, s, on the clock of `program`. */
  begin: number[];
  end: number[];
}

/** A finding of the preflight of a program. */
export interface FindingEntry {
  /** `error` or `warning`. */
  level: string;
  message: string;
  place: string;
  /** Null if it concerns no line, as `line`. */
  file: string | null;
  line: number | null;
}

/** The program in a robot's language. */
export interface ProgramTextMessage {
  type: "program_text";
  language: string;
  revision: number;
  files: FileEntry[];
  findings: FindingEntry[];
  /** Sentences, as `faults`. */
  notes: string[];
  faults: string[];
}

/** A job that is kept for comparison; its plans are at `/kept/ID`. */
export interface KeptEntry {
  id: number;
  name: string;
  revision: number;
  metric: string;
  objective: string;
  /** The names of those that have plans. */
  contours: string[];
  cycle: Cycle | null;
  /** False while a bound of its plans is being computed. */
  settled: boolean;
}

/** The jobs that are kept for comparison. */
export interface KeptMessage {
  type: "kept";
  plans: KeptEntry[];
}

/** A criterion of a Pareto set. */
export interface AxisEntry {
  name: string;
  words: string;
  unit: string;
  better: "more" | "less";
}

/** A run of the planner. */
export interface PointEntry {
  number: number;
  /** Of the axes, in their units. */
  values: number[];
  /** Whether no other point is as good in all criteria and better in one. */
  best: boolean;
  /** They make its plan the job's; null if a job has no keys for its settings. */
  edits: EditEntry[] | null;
}

/** The points of a contour's Pareto set that have been found so far. */
export interface FrontMessage {
  type: "front";
  revision: number;
  contour: string;
  axes: AxisEntry[];
  points: PointEntry[];
  /** Runs. */
  done: number;
  total: number;
  state: "running" | "done" | "stopped";
}

/** The motion of a point of the Pareto set; it is not the plan of the job. */
export interface CandidateMessage {
  type: "candidate";
  contour: string;
  number: number;
  /** Its `checks` are null. */
  plan: PlanMessage;
}

/** The nodes of a contour that the robot reaches at no gamma and in no posture of the job. */
export interface OutOfReach {
  name: string;
  /** The number of nodes. */
  nodes: number;
  out: number[];
}

/** The nodes of each contour that the robot cannot reach at a placement. The cell is not checked. */
export interface ReachMessage {
  type: "reach";
  /** Of the scene that it refers to. */
  revision: number;
  /** Of the question. */
  number: number;
  /** (3) m, the point about which the part turns. */
  middle: number[];
  contours: OutOfReach[];
}

/** A placement that the search has tried. */
export interface TryEntry {
  number: number;
  offsets: Record<string, number>;
  status: "feasible" | "speed" | "collision" | "unreachable";
  /** The test that decided. */
  stage: string;
  value: number | null;
  /** What it cannot beat. */
  bound: number | null;
  estimate: number | null;
  /** Why it is infeasible. */
  reason: string | null;
  /** The pose that moves the part in the robot's base. */
  part: number[];
  /** The same for everything else except the robot. */
  rest: number[];
}

/** The search for the best placement. */
export interface LayoutMessage {
  type: "layout";
  revision: number;
  goal: "speed" | "margin" | "motion";
  /** As requested. */
  grid: boolean;
  /** Of its values. */
  unit: string;
  /** The best 20 of the placements that were tried: first those with a value, then estimates, then infeasible ones. */
  best: TryEntry[];
  /** The number of placements; `feasible`: of those that are. */
  tried: number;
  feasible: number;
  /** The progress, with `done` and `total`. */
  label: string;
  done: number;
  total: number;
  state: "running" | "done" | "stopped";
  /** A final sentence on what is known of the other placements. */
  said: string;
}

/** An error. */
export interface ErrorMessage {
  type: "error";
  /** One line. */
  message: string;
  /** The type of the message that it answers. */
  about: string | null;
}

/** Sets one key of the job; null removes it. */
export interface Edit {
  type: "edit";
  /** As `["plan", "weights"]` or `["contour", 0, "speed_m_min"]`. */
  path: (string | number)[];
  value: any;
  /** Any text, one for each drag of a slider: edits of the same `path` with the same gesture are one step of undo. */
  gesture?: string | null;
}

/** One key of the job and its new value; null removes it. */
export interface Change {
  path: (string | number)[];
  value: any;
}

/** Sets several keys of the job, in one step of undo. */
export interface Edits {
  type: "edits";
  edits: Change[];
}

/** Replaces the text of the job. */
export interface ReplaceText {
  type: "text";
  text: string;
}

/** Goes one step back or forward, plans again, for example after `cancel`, or stops all work. */
export interface Command {
  type: "undo" | "redo" | "plan" | "cancel";
}

/** Writes the job file. If the file has changed since it was read, this is refused, unless `over` is true. */
export interface Save {
  type: "save";
  over?: boolean;
}

/** Plans a contour first from now on, asks for its `map`, or searches for its fastest speed. */
export interface ContourRequest {
  type: "focus" | "map" | "fastest";
  contour: string;
}

/** Asks for `pose`: the joints there, and the reason if they are lost. */
export interface PoseRequest {
  type: "reason";
  contour: string;
  node: number;
  gamma: number;
  posture: number;
}

/** Asks for `shade`; a newer request of a page replaces the one before. */
export interface ShadeRequest {
  type: "shade";
  contour: string;
  /** Null stops the computation. */
  by: string | null;
}

/** Asks for `technique`. */
export interface TechniqueRequest {
  type: "technique";
  contour: string;
  /** Null stops the computation. */
  method: "paper" | "known" | null;
}

/** Makes the edits of one of the relaxations of `nopath`, as one step of undo. */
export interface Relax {
  type: "relax";
  contour: string;
  index: number;
}

/** Makes loops of the part contours of the job, as one step of undo. Each is cut like the most similar contour. */
export interface CutLoops {
  type: "cut";
  /** Their names. */
  loops: string[];
  /** Whether the job then cuts these loops alone: those that it cuts already stay, all others go. */
  alone?: boolean;
}

/** Removes this table of `contour` from the job. */
export interface RemoveContour {
  type: "leave";
  index: number;
}

/** Keeps the current job with its plans for comparison. */
export interface Keep {
  type: "keep";
  /** By default the next letter. */
  name?: string | null;
}

/** Renames a kept job. */
export interface Rename {
  type: "rename";
  id: number;
  name: string;
}

/** Makes the text of a kept job that of the job, as one step of undo, or drops a kept job. */
export interface KeptCommand {
  type: "restore" | "forget";
  id: number;
}

/** Searches for the Pareto set of a contour; answered by `front`. */
export interface FrontRequest {
  type: "front";
  contour: string;
  /** Words of the `criteria` of `options`. */
  criteria: string[];
  runs: number;
}

/** Asks for `candidate`, the motion of a point of that set. */
export interface CandidateRequest {
  type: "point";
  contour: string;
  number: number;
}

/** Asks for `reach`. If several questions wait, only the newest is answered. */
export interface ReachRequest {
  type: "reach";
  /** Moves of part, robot base and head from their places in `scene`, mm or deg, by the variables of `[layout]`. */
  offsets: Record<string, number>;
  number: number;
}

/** Applies offsets, as in `reach`, to the job, as one step of undo. */
export interface Place {
  type: "place";
  /** The `revision` of the scene that they refer to; if there is a newer one, this is refused. */
  scene: number;
  offsets: Record<string, number>;
}

/** Searches for the best placement, as `kerfpath layout` does; answered by `layout`. */
export interface LayoutRequest {
  type: "layout";
  goal: "speed" | "margin" | "motion";
  /** Of offsets, by variable: `[least, most]`. */
  ranges: Record<string, [number, number]>;
  evaluations: number;
  /** Whether placements are judged as with `method = "exact"`, whatever the job has. */
  grid: boolean;
}

/** Applies a placement of that search to the job, as one step of undo. */
export interface Take {
  type: "take";
  number: number;
}

/** Asks for `program_text`. */
export interface ProgramRequest {
  type: "program";
  /** By default that of the job. */
  language?: string | null;
}

export type ServerMessage =
  | JobMessage
  | OptionsMessage
  | SceneMessage
  | PartMessage
  | ProgressMessage
  | PlanMessage
  | ClearanceMessage
  | NoPathMessage
  | ProgramMessage
  | OutcomeMessage
  | MapMessage
  | ShadeMessage
  | TechniqueMessage
  | PoseMessage
  | FastestMessage
  | ProgramTextMessage
  | KeptMessage
  | FrontMessage
  | CandidateMessage
  | ReachMessage
  | LayoutMessage
  | ErrorMessage;

export type ClientMessage =
  | Edit
  | Edits
  | ReplaceText
  | Command
  | Save
  | ContourRequest
  | PoseRequest
  | ShadeRequest
  | TechniqueRequest
  | Relax
  | CutLoops
  | RemoveContour
  | Keep
  | Rename
  | KeptCommand
  | FrontRequest
  | CandidateRequest
  | ReachRequest
  | Place
  | LayoutRequest
  | Take
  | ProgramRequest;
