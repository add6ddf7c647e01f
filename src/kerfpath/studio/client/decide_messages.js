/**
 * Messages of the server about kept plans, Pareto sets and other placements of the part.
 * Units and meaning: README.md of the studio.
 */

/** @typedef {import("./messages.js").Edit} Edit */
/** @typedef {import("./messages.js").PlanMessage} PlanMessage */

/**
 * @typedef {object} KeptEntry
 * @property {number} id
 * @property {string} name
 * @property {number} revision
 * @property {string} metric
 * @property {string} objective
 * @property {string[]} contours
 * @property {{cutting: number, air: number, piercing: number, total: number} | null} cycle
 * @property {boolean} settled
 */

/**
 * @typedef {object} FrontPoint
 * @property {number} number
 * @property {number[]} values  of the axes, in their units
 * @property {boolean} best
 * @property {Edit[] | null} edits
 */

/**
 * @typedef {object} FrontMessage
 * @property {"front"} type
 * @property {number} revision
 * @property {string} contour
 * @property {{name: string, words: string, unit: string, better: "more" | "less"}[]} axes
 * @property {FrontPoint[]} points
 * @property {number} done
 * @property {number} total
 * @property {"running" | "done" | "stopped"} state
 */

/**
 * @typedef {object} ReachMessage
 * @property {"reach"} type
 * @property {number} revision
 * @property {number} number
 * @property {number[]} middle
 * @property {{name: string, nodes: number, out: number[]}[]} contours
 */

/**
 * @typedef {object} Try  a placement that the search has tried
 * @property {number} number
 * @property {Record<string, number>} offsets
 * @property {"feasible" | "speed" | "collision" | "unreachable"} status
 * @property {string} stage
 * @property {number | null} value
 * @property {number | null} bound
 * @property {number | null} estimate
 * @property {string | null} reason
 * @property {number[]} part  16, the pose that moves the part in the robot's base
 * @property {number[]} rest  16, the same for everything else except the robot
 */

/**
 * @typedef {object} LayoutMessage
 * @property {"layout"} type
 * @property {number} revision
 * @property {"speed" | "margin" | "motion"} goal
 * @property {boolean} grid
 * @property {string} unit
 * @property {Try[]} best
 * @property {number} tried
 * @property {number} feasible
 * @property {string} label
 * @property {number} done
 * @property {number} total
 * @property {"running" | "done" | "stopped"} state
 * @property {string} said
 */

/** @typedef {{type: "candidate", contour: string, number: number, plan: PlanMessage}} CandidateMessage */

/** @typedef {{type: "kept", plans: KeptEntry[]}} KeptMessage */

export {};
