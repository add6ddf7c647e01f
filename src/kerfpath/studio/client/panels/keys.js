/** The keys of the job that have a control under "All options", in groups. */

/**
 * @typedef {object} Key
 * @property {string} key  dotted; "contour.x" is x of the chosen contour's table
 * @property {string} label
 * @property {"number" | "words" | "switch" | "table" | "list" | "joints"} kind
 * @property {string} [unit]
 * @property {string} [hint]
 * @property {string} [needs]  a key that this one requires
 * @property {string} [table]  a table that requires this key and is removed with it
 * @property {[string, number]} [beside]  a key that is set with this one, and its value
 */

/** @type {(key: string, label: string, unit?: string, more?: Partial<Key>) => Key} */
const number = (key, label, unit = "", more = {}) => ({
  key,
  label,
  unit,
  kind: "number",
  ...more,
});

/** @type {(key: string, label: string, more?: Partial<Key>) => Key} */
const words = (key, label, more = {}) => ({ key, label, kind: "words", ...more });

/** @type {(key: string, label: string, more?: Partial<Key>) => Key} */
const yes = (key, label, more = {}) => ({ key, label, kind: "switch", ...more });

/**
 * @param {string} which
 * @param {string} name
 * @returns {Key[]}
 */
const lead = (which, name) => {
  const needs = `contour.${which}.length_mm`;
  return [
    number(needs, `${name}, length`, "mm", { table: `contour.${which}` }),
    words(`contour.${which}.shape`, `${name}, shape`, { needs }),
    number(`contour.${which}.angle_deg`, `${name}, angle`, "deg", { needs }),
    number(`contour.${which}.fan_mm`, `${name}, fan`, "mm", { needs }),
    number(`contour.${which}.speed_share`, `${name}, share of the speed`, "", { needs }),
  ];
};

/**
 * @param {string} name
 * @param {string} label
 * @param {string} unit
 * @param {string} [suffix]
 * @returns {Key[]}
 */
const band = (name, label, unit, suffix = unit) => {
  const [width, cost] = [`comfort.${name}_band_${suffix}`, `comfort.${name}_cost`];
  return [
    ...(name === "clearance"
      ? []
      : [number(`comfort.${name}_margin_${suffix}`, `${label}, margin`, unit)]),
    number(width, `${label}, band width`, unit, { beside: [cost, 1] }),
    number(cost, `${label}, cost`, "", { needs: width, beside: [width, 0] }),
  ];
};

/** The title of the group of external axes; each axis has its own keys. */
export const EXTERNAL = "External axes";

/** @type {{title: string, contour?: boolean, keys: Key[]}[]} */
export const GROUPS = [
  {
    title: "Objective and limits",
    keys: [
      words("plan.objective", "Objective"),
      words("plan.metric", "Metric"),
      words("plan.posture", "Posture"),
      number("plan.eta_velocity", "Share of the speed limits"),
      number("plan.eta_acceleration", "Share of the acceleration limits"),
    ],
  },
  {
    title: EXTERNAL,
    keys: [],
  },
  {
    title: "Place of the part",
    keys: [
      { key: "part.xyz_mm", label: "x, y, z", unit: "mm", kind: "list" },
      { key: "part.rpy_deg", label: "Roll, pitch, yaw", unit: "deg", kind: "list" },
    ],
  },
  {
    title: "Search",
    keys: [
      words("plan.method", "Method", { hint: "continuous: gamma is not restricted to a grid" }),
      number("plan.gamma_step_deg", "Step of gamma", "deg"),
      words("plan.closure", "Closed contours", { hint: "periodic: the motion ends as it begins" }),
      number("plan.rotation_deg", "Rotation of endless joints, at most", "deg"),
      words("plan.frames", "Frames"),
      yes("plan.refine", "Refined off the grid"),
      number("plan.refine_parts", "Parts of the refinement"),
      words("plan.between_nodes", "Limits between the nodes"),
    ],
  },
  {
    title: "Feed reductions and pieces",
    keys: [
      words("plan.feed", "Feed", { hint: "dip: slow down where needed" }),
      words("plan.interruptions", "Interruptions", { hint: "fewest: cut in pieces" }),
      number("plan.least_piece_mm", "Shortest piece", "mm"),
    ],
  },
  {
    title: "Tolerance of the tool axis",
    keys: [
      number("plan.tilt_deg", "Tilt, at most", "deg"),
      number("plan.tilt_steps", "Steps of the tilt", "", { needs: "plan.tilt_deg" }),
      number("plan.tilt_cost_per_deg", "Cost of the tilt", "per deg", { needs: "plan.tilt_deg" }),
    ],
  },
  {
    title: "Margins",
    keys: [
      ...band("limits", "Joint limits", "deg"),
      ...band("wrist", "Wrist singularity", "deg"),
      ...band("elbow", "Elbow singularity", "deg"),
      ...band("shoulder", "Shoulder singularity", "mm"),
      ...band("manipulability", "Manipulability", "m\u00b3", "m3"),
      ...band("clearance", "Clearance", "mm"),
    ],
  },
  {
    title: "Bound",
    keys: [
      yes("plan.certify", "Bound of the cost"),
      number("plan.certify_gap_percent", "Required gap", "%", { needs: "plan.certify" }),
      number("plan.certify_seconds", "Time limit", "s", { needs: "plan.certify" }),
    ],
  },
  {
    title: "Order and transfer moves",
    keys: [
      { key: "sequence", label: "Plan transfer moves", kind: "table" },
      words("sequence.order", "Order", { needs: "sequence" }),
      yes("sequence.inner_first", "Inner contours first", { needs: "sequence" }),
      number("sequence.heat_spacing_mm", "Heat spacing", "mm", { needs: "sequence" }),
      number("sequence.seconds", "Time limit for the order", "s", { needs: "sequence" }),
      { key: "sequence.home_deg", label: "Home", unit: "deg", kind: "joints", needs: "sequence" },
    ],
  },
  {
    title: "The cut",
    contour: true,
    keys: [
      words("contour.start", "Start"),
      number("contour.start_mm", "Start at", "mm"),
      words("contour.direction", "Direction"),
      number("contour.candidates", "Number of starts to try"),
      words("contour.scrap", "Scrap side"),
      number("contour.kerf_mm", "Kerf", "mm"),
      number("contour.bevel_deg", "Bevel", "deg"),
      number("contour.overlap_mm", "Overlap", "mm"),
    ],
  },
  {
    title: "Leads",
    contour: true,
    keys: [...lead("lead_in", "Lead-in"), ...lead("lead_out", "Lead-out")],
  },
  {
    title: "Micro joints and corners",
    contour: true,
    keys: [
      number("contour.micro_joints.count", "Micro joints", "", {
        table: "contour.micro_joints",
        beside: ["contour.micro_joints.width_mm", 0.4],
      }),
      number("contour.micro_joints.width_mm", "Width of a micro joint", "mm", {
        needs: "contour.micro_joints.count",
        table: "contour.micro_joints",
      }),
      number("contour.corners.round_mm", "Corners rounded by", "mm"),
      number("contour.corners.loop_mm", "Loop at corners, radius", "mm"),
      number("contour.corners.slow_share", "Share of the speed at corners"),
    ],
  },
];

/** @typedef {{name: string, kind: "linear" | "rotary", endless: boolean}} External */

/**
 * Return the keys of the external axes of a job, in the units of their kinds.
 * @param {External[]} axes
 * @returns {Key[]}
 */
export const externalKeys = (axes) =>
  axes.flatMap(({ name, kind, endless }, i) => {
    const [table, unit] = [`robot.external.${i}`, kind === "linear" ? "mm" : "deg"];
    /** @type {(key: string, label: string, per?: string) => Key} */
    const own = (key, label, per = "") =>
      number(`${table}.${key}_${unit}${per.replace("/", "_")}`, `${name}, ${label}`, unit + per);
    /** @type {(key: string, label: string, unit?: string) => Key} */
    const list = (key, label, unit) => ({
      ...{ key: `${table}.${key}`, label: `${name}, ${label}`, unit, kind: "list" },
    });
    return [
      list("axis", "direction"),
      ...(kind === "rotary" ? [list("point_mm", "point on the axis", "mm")] : []),
      ...(endless ? [] : [own("lower", "lower limit"), own("upper", "upper limit")]),
      own("velocity", "speed", "/s"),
      own("acceleration", "acceleration", "/s2"),
      own("home", "home"),
      own("step", "grid step"),
    ];
  });

/** The ways to sample a contour: its table has exactly one of these keys. */
export const SAMPLINGS = {
  spacing_mm: { label: "spacing", unit: "mm", usual: 2 },
  time_step_ms: { label: "time step", unit: "ms", usual: 20 },
  tolerance_mm: { label: "tolerance", unit: "mm", usual: 0.05 },
  count: { label: "count", unit: "", usual: 200 },
};
