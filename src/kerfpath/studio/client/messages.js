/**
 * The types of the messages between server and page, as in README.md.
 * Values are in m, rad and s in the robot's base frame unless a key carries its unit; arrays of
 * vectors are flat and row-major; a pose is 16 numbers, row-major.
 */

/** @typedef {(string | number)[]} Path a key of the job, such as ["contour", 0, "speed_m_min"] */
/** @typedef {{key: Path, message: string}} Fault */
/** @typedef {{path: Path, value: unknown}} Edit */

/**
 * @typedef {object} JobMessage
 * @property {"job"} type
 * @property {number} revision
 * @property {string} name
 * @property {string} text
 * @property {Record<string, any> | null} values
 * @property {string[]} given  dotted keys that are in the text
 * @property {{name: string, index: number}[]} contours
 * @property {boolean} undo
 * @property {boolean} redo
 * @property {boolean} saved
 * @property {Fault[]} faults
 * @property {Record<string, string[]>} choices
 * @property {number[] | null} weights  1/rad or 1/m, those that hold where the job has none
 */

/**
 * @typedef {object} Joint  of the arm, or an external axis
 * @property {string} name
 * @property {"rad" | "m"} unit  of its values
 * @property {"robot" | "part" | null} carries  what an external axis moves
 * @property {number[]} T  16, its frame at 0 in that of the joint before it; of an external axis: in the room
 * @property {number[]} axis  3, unit vector in its own frame
 * @property {number | null} lower
 * @property {number | null} upper
 * @property {boolean} endless
 * @property {number} velocity  rad/s or m/s
 * @property {number} acceleration  rad/s2 or m/s2
 */

/**
 * @typedef {object} RobotModel
 * @property {string} id
 * @property {Joint[]} joints  those of the arm, then the external axes
 * @property {number[]} T_flange  16, in the last joint's frame
 * @property {number[]} T_tool  16, the tip in the flange
 */

/**
 * @typedef {object} Body
 * @property {string} name
 * @property {"robot" | "head" | "part" | "fixture" | "floor"} kind
 * @property {number} frame  of those of kinematics.js
 * @property {string} mesh
 * @property {boolean} approximate
 */

/**
 * @typedef {object} ContourShape
 * @property {string} name
 * @property {number} index
 * @property {string} loop
 * @property {boolean} closed
 * @property {number[]} points
 * @property {number[]} axes
 * @property {number[]} s
 * @property {string[]} kind
 * @property {number} speed_m_min
 */

/**
 * @typedef {object} SceneMessage
 * @property {"scene"} type
 * @property {number} revision
 * @property {RobotModel} robot
 * @property {{q: number[], T: number[]}} sample
 * @property {Body[]} bodies
 * @property {number[]} T_part
 * @property {ContourShape[]} contours
 * @property {boolean} cell
 */

/**
 * @typedef {object} Loop  of the part, in the base
 * @property {string} name
 * @property {string} face
 * @property {"outer" | "inner" | "open"} kind
 * @property {"outer" | "inner" | "edge" | ""} side
 * @property {boolean} closed
 * @property {number} length
 * @property {number | null} diameter
 * @property {number} gap
 * @property {number[]} points
 */

/**
 * @typedef {object} PartMessage
 * @property {"part"} type
 * @property {number} revision
 * @property {Loop[]} loops
 * @property {{name: string, triangles: number}[]} faces
 * @property {number} left_out
 */

/** @typedef {{type: "progress", busy: boolean, label: string, done: number, total: number}} ProgressMessage */

/**
 * @typedef {object} Check
 * @property {string} code
 * @property {string} title
 * @property {number | null} value
 * @property {number | null} limit
 * @property {string} unit
 * @property {string} level
 * @property {boolean} ok
 * @property {number | null} node
 */

/**
 * @typedef {object} Criteria
 * @property {number[]} displacement
 * @property {number[]} largest_increment
 * @property {number[]} range
 * @property {number[]} peak_velocity
 * @property {number[]} peak_acceleration
 * @property {{name: string, value: number | null, unit: string, node: number}[]} nearest
 */

/**
 * @typedef {object} PlanMessage
 * @property {"plan"} type
 * @property {number} revision
 * @property {string} contour
 * @property {string} name
 * @property {number} pieces
 * @property {string} graph
 * @property {number[]} s
 * @property {number[]} time
 * @property {number[]} q
 * @property {number[]} gamma
 * @property {number[]} posture
 * @property {number[]} points
 * @property {string[]} kind
 * @property {number[]} speed
 * @property {number} cost
 * @property {number | null} bound
 * @property {number | null} gap
 * @property {boolean} settled
 * @property {boolean} optimal
 * @property {string} statement
 * @property {string} method
 * @property {number[]} weights
 * @property {number | null} previous_cost
 * @property {Criteria} criteria
 * @property {number[]} velocity_share
 * @property {number[]} acceleration_share
 * @property {number[]} joint_load
 * @property {Check[] | null} checks
 * @property {boolean | null} passed
 * @property {string | null} feed
 * @property {number} seconds
 */

/**
 * @typedef {object} ClearanceMessage
 * @property {"clearance"} type
 * @property {number} revision
 * @property {string} contour
 * @property {string} name
 * @property {(number | null)[]} distance
 * @property {(number | null)[]} over
 * @property {number[]} pair
 * @property {string[][]} pairs
 */

/** @typedef {{label: string, edits: Edit[]}} Relaxation */

/**
 * @typedef {object} NoPathMessage
 * @property {"nopath"} type
 * @property {number} revision
 * @property {string} contour
 * @property {number} node
 * @property {number | null} back
 * @property {number | null} s
 * @property {number[] | null} point
 * @property {string} statement
 * @property {"every gamma" | "grid" | "undecided"} scope
 * @property {{name: string, count: number}[]} reasons
 * @property {string | null} graph
 * @property {Relaxation[] | null} relaxations
 * @property {string | null} remedy
 */

/**
 * @typedef {object} Segment
 * @property {"move" | "approach" | "pierce" | "cut" | "retract"} kind
 * @property {number} begin
 * @property {number} end
 * @property {string | null} contour
 * @property {string | null} [plan]
 * @property {number[] | null} time
 * @property {number[] | null} q
 */

/**
 * @typedef {object} ProgramMessage
 * @property {"program"} type
 * @property {number} revision
 * @property {number} total
 * @property {Segment[]} segments
 * @property {boolean} checked
 * @property {string[]} notes
 */

/** @typedef {{name: string, href: string, ready: boolean, why: string | null}} Export */

/**
 * @typedef {object} OutcomeMessage
 * @property {"outcome"} type
 * @property {number} revision
 * @property {boolean | null} passed
 * @property {Export[]} exports
 * @property {{cutting: number, air: number, piercing: number, total: number} | null} cycle
 * @property {string[]} notes
 */

/** @typedef {import("./decide_messages.js").CandidateMessage} CandidateMessage */
/** @typedef {import("./decide_messages.js").FrontMessage} FrontMessage */
/** @typedef {import("./decide_messages.js").FrontPoint} FrontPoint */
/** @typedef {import("./decide_messages.js").KeptEntry} KeptEntry */
/** @typedef {import("./decide_messages.js").KeptMessage} KeptMessage */
/** @typedef {import("./decide_messages.js").LayoutMessage} LayoutMessage */
/** @typedef {import("./decide_messages.js").ReachMessage} ReachMessage */
/** @typedef {import("./decide_messages.js").Try} Try */

/**
 * @typedef {object} MapMessage
 * @property {"map"} type
 * @property {number} revision
 * @property {string} contour
 * @property {string} graph
 * @property {number[]} s
 * @property {number[]} gamma
 * @property {number} nodes
 * @property {string[]} reasons
 * @property {string[]} kinds
 * @property {string[]} colours
 * @property {{posture: number, name: string, codes: string}[]} layers
 * @property {string[]} hidden
 * @property {string} external  where the external axes are at its poses, "" without any
 * @property {{by: string, words: string, unit: string}[]} shades
 * @property {{name: string, s: number[], gamma: number[], posture: number[]}[]} course
 */

/**
 * @typedef {object} ShadeMessage
 * @property {"shade"} type
 * @property {number} revision
 * @property {string} contour
 * @property {string} graph
 * @property {string} by
 * @property {string} words
 * @property {string} unit
 * @property {number} low
 * @property {number} high
 * @property {boolean} beyond
 * @property {{posture: number, values: string, nearest: string | null}[]} layers
 * @property {string[][]} pairs
 */

/**
 * @typedef {object} TechniqueMessage
 * @property {"technique"} type
 * @property {number} revision
 * @property {string} contour
 * @property {"paper" | "known"} method
 * @property {number[]} s
 * @property {number[]} gamma
 * @property {number[]} posture
 * @property {number | null} cost
 * @property {(number | null)[]} peak_velocity
 * @property {(number | null)[]} peak_acceleration
 * @property {string} statement
 * @property {string[]} notes
 */

/**
 * @typedef {object} PoseMessage
 * @property {"pose"} type
 * @property {string} contour
 * @property {number} node
 * @property {number} gamma
 * @property {number} posture
 * @property {number[] | null} q
 * @property {boolean} admitted
 * @property {string} reason
 */

/**
 * @typedef {object} FastestMessage
 * @property {"fastest"} type
 * @property {number} revision
 * @property {string} contour
 * @property {number | null} speed_m_min
 * @property {number | null} on_grid_m_min
 * @property {string} binds
 * @property {Edit[]} edits
 */

/**
 * @typedef {object} ProgramFile  its lines that move or wait, and when
 * @property {string} name
 * @property {string} text
 * @property {number[]} lines
 * @property {number[]} begin
 * @property {number[]} end
 */

/** @typedef {{level: string, message: string, place: string, file: string | null, line: number | null}} Finding */

/**
 * @typedef {object} ProgramTextMessage
 * @property {"program_text"} type
 * @property {string} language
 * @property {number} revision
 * @property {ProgramFile[]} files
 * @property {Finding[]} findings
 * @property {string[]} notes
 * @property {string[]} faults
 */

/** @typedef {{type: "error", message: string, about: string | null}} ErrorMessage */

/**
 * @typedef {JobMessage | PartMessage | ClearanceMessage | SceneMessage | ProgressMessage | PlanMessage | NoPathMessage
 *   | ProgramMessage | OutcomeMessage | MapMessage | PoseMessage | FastestMessage
 *   | ShadeMessage | TechniqueMessage | ProgramTextMessage | KeptMessage | FrontMessage
 *   | CandidateMessage | ReachMessage | LayoutMessage | ErrorMessage} ServerMessage
 */

/** @typedef {{type: string} & Record<string, unknown>} ClientMessage */

export {};
