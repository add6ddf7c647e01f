/** The state of the page: the newest messages, the chosen contour, and listeners to changes. */

/** @import { KeptEntry, NoPathMessage, PlanMessage, ServerMessage } from "./messages.js" */
/** @typedef {{entry: KeptEntry, plans: Map<string, PlanMessage[]>}} Against */
/** @typedef {{name: string, s: number[], gamma: number[], posture: number[]}} Course */

/**
 * What may change: a type of message, or a state of the page; "anything" is any of them.
 * @typedef {ServerMessage["type"] | "connection" | "pointed" | "selected" | "compare" | "dismissed"
 *   | "sheet" | "anything"} Topic
 */

/** Of these types only the newest message is kept, under its type. */
const LATEST = /** @type {const} */ ([
  ...["job", "options", "part", "scene", "program", "outcome", "fastest", "pose"],
  ...["program_text", "front", "reach", "layout"],
]);
/** @typedef {(typeof LATEST)[number]} Latest */

const MOST_SHADES = 12; // some 100 kB each
const MOST_ERRORS = 3;
const ERROR_STAYS = 12_000; // ms

/** @type {new () => {[T in Latest]: Extract<ServerMessage, {type: T}> | null}} */
const Messages = /** @type {any} */ (
  class {
    constructor() {
      for (const type of LATEST) Object.assign(this, { [type]: null });
    }
  }
);

/** The state of the page. A message changes it; then the listeners to its topic are called. */
export class Store extends Messages {
  constructor() {
    super();
    /** @type {import("./connection.js").Status} */
    this.connection = "connecting";
    /** @type {number | null} time of the next try, ms */
    this.retryAt = null;
    /** @type {import("./messages.js").JobMessage | null} the newest job without a fault */
    this.valid = null;
    this.met = false; // whether the connection has ever been open
    this.broken = false; // whether it has been lost since it was last open
    /** @type {import("./messages.js").ProgressMessage} */
    this.progress = { type: "progress", busy: false, label: "", done: 0, total: 0 };
    /** @type {import("./messages.js").ErrorMessage[]} those that are shown */
    this.errors = [];
    /** @type {Map<string, PlanMessage[]>} by contour, its pieces in order */
    this.plans = new Map();
    /** @type {Map<string, PlanMessage[]>} by contour, the plans before its last change */
    this.before = new Map();
    /** @type {WeakMap<PlanMessage, string>} metric, objective and weights of each plan */
    this.asked = new WeakMap();
    /** @type {Map<string, NoPathMessage>} */
    this.nopaths = new Map();
    /** @type {Map<string, import("./messages.js").ClearanceMessage>} by the names of plans */
    this.clearances = new Map();
    /** @type {Map<string, import("./messages.js").MapMessage>} */
    this.maps = new Map();
    /** @type {Map<string, import("./messages.js").ShadeMessage>} by contour and quantity */
    this.shades = new Map();
    /** @type {Map<string, import("./messages.js").TechniqueMessage>} by contour and method */
    this.techniques = new Map();
    /** @type {string | null} the loop whose contour is chosen once it is in the scene */
    this.awaited = null;
    /** @type {KeptEntry[]} jobs that are kept for comparison */
    this.kept = [];
    /** @type {Against | null} the kept job that is compared */
    this.against = null;
    /** @type {{contour: string, number: number, own: PlanMessage[]} | null} shown in place of the job's plan */
    this.candidate = null;
    /** @type {string | null} the chosen contour */
    this.selected = null;
    /** @type {Map<string, Set<(about: any) => void>>} */
    this.listeners = new Map();
  }

  /**
   * Call `listener` after each change of a topic; "anything" is every topic.
   * @param {Topic[]} topics
   * @param {(about: any) => void} listener
   */
  on(topics, listener) {
    for (const topic of topics) {
      const known = this.listeners.get(topic) ?? new Set();
      this.listeners.set(topic, known.add(listener));
    }
  }

  /** @type {(topic: Topic, about?: unknown) => void} */
  emit(topic, about) {
    for (const each of [topic, /** @type {const} */ ("anything")])
      for (const listener of this.listeners.get(each) ?? []) listener(about);
  }

  /** @type {(status: import("./connection.js").Status, retryAt: number | null) => void} */
  connected(status, retryAt) {
    this.connection = status;
    this.retryAt = retryAt;
    this.met ||= status === "open";
    this.broken = status === "lost" || (this.broken && status !== "open");
    this.emit("connection");
  }

  /** @param {string | null} contour */
  select(contour) {
    if (contour === this.selected) return;
    this.selected = contour;
    this.emit("selected");
  }

  /**
   * Compare with a kept job; null: with none.
   * @param {Against | null} against
   */
  compareWith(against) {
    this.against = against;
    this.emit("compare");
  }

  /**
   * Return the other courses of a contour: of the compared job, else those before the last change.
   * @param {string} contour
   * @returns {Course[]}
   */
  beside(contour) {
    if (!this.against) return this.before.get(contour) ?? [];
    const { name } = this.against.entry;
    const plans = this.against.plans.get(contour) ?? [];
    return plans.map(({ s, gamma, posture }) => ({ name, s, gamma, posture }));
  }

  /**
   * Return the plans of a contour in the compared job; none if its robot has other joints.
   * @param {string} contour
   */
  compared(contour) {
    return (this.against?.plans.get(contour) ?? []).filter((plan) => this.fits(plan));
  }

  /**
   * Whether a plan has the joints of the robot that is shown.
   * @param {PlanMessage} plan
   */
  fits(plan) {
    return plan.weights.length === this.scene?.robot.joints.length;
  }

  /**
   * Return the name of the other courses, or null without any.
   * @param {string} contour
   */
  besideOf(contour) {
    return this.beside(contour).length ? (this.against?.entry.name ?? "before") : null;
  }

  /** Whether the job can be edited. */
  get live() {
    return this.connection === "open" && Boolean(this.job?.values);
  }

  /** The plans of the chosen contour. */
  get chosen() {
    return this.plans.get(this.selected ?? "") ?? [];
  }

  /** The index of the chosen contour's table in the job, or null. */
  get table() {
    const known = [...(this.job?.contours ?? []), ...(this.scene?.contours ?? [])];
    return known.find(({ name }) => name === this.selected)?.index ?? null;
  }

  /** The names of all contours, in the order of the job. */
  contours() {
    return (this.scene?.contours ?? this.job?.contours ?? []).map((each) => each.name);
  }

  /**
   * Whether the result of a revision is out of date.
   * @param {{revision: number}} message
   */
  stale(message) {
    return message.revision < (this.job?.revision ?? 0);
  }

  /** @param {ServerMessage} message */
  take(message) {
    switch (message.type) {
      case "job":
        this.job = message;
        if (message.values) this.valid = message;
        break;
      case "scene":
        this.scene = message;
        this.shades.clear(); // robot or cell may have changed
        this.techniques.clear();
        this.dropMissing();
        break;
      case "plan":
        this.takePlan(message);
        break;
      case "nopath":
        return this.takeNoPath(message);
      case "candidate":
        return this.propose(message);
      case "clearance":
        this.clearances.set(message.name, message);
        break;
      case "map":
        this.maps.set(message.contour, message);
        break;
      case "shade":
        this.shades.delete(`${message.contour} ${message.by}`);
        this.shades.set(`${message.contour} ${message.by}`, message);
        if (this.shades.size > MOST_SHADES) this.shades.delete([...this.shades.keys()][0]);
        break;
      case "technique":
        this.techniques.set(`${message.contour} ${message.method}`, message);
        break;
      case "kept":
        this.kept = message.plans;
        break;
      case "error":
        this.warn(message);
        break;
      default: // the newest of its type
        Object.assign(this, { [message.type]: message });
    }
    return this.emit(message.type, message);
  }

  /**
   * Keep an error for a while.
   * @param {import("./messages.js").ErrorMessage} error
   */
  warn(error) {
    if (this.errors.some(({ message }) => message === error.message)) return;
    this.errors = [...this.errors, error].slice(-MOST_ERRORS);
    window.setTimeout(() => this.dismiss(error), ERROR_STAYS);
  }

  /** @param {import("./messages.js").ErrorMessage} error */
  dismiss(error) {
    this.errors = this.errors.filter((each) => each !== error);
    this.emit("dismissed");
  }

  /**
   * Show a motion in place of the plan of its contour, until that is planned again.
   * @param {import("./messages.js").CandidateMessage} message
   */
  propose({ contour, number, plan }) {
    this.withdraw();
    const own = this.plans.get(contour);
    if (!own || own[0].revision !== plan.revision) return;
    this.candidate = { contour, number, own };
    this.asked.set(plan, `candidate ${number}`);
    this.plans.set(contour, [plan]);
    this.emit("plan", plan);
    this.emit("candidate");
  }

  /** Show the job's own plan again. */
  withdraw() {
    if (!this.candidate) return;
    const { contour, own } = this.candidate;
    this.candidate = null;
    this.plans.set(contour, own);
    this.emit("plan", own[0]);
    this.emit("candidate");
  }

  /** @param {PlanMessage} plan */
  takePlan(plan) {
    const { candidate } = this;
    if (candidate?.contour === plan.contour && candidate.own[0].revision === plan.revision) {
      // The bound of the job's own plan may arrive while a point is shown.
      candidate.own = candidate.own.map((each) => (each.name === plan.name ? plan : each));
      this.asked.set(plan, this.question(plan));
      return;
    }
    if (candidate?.contour === plan.contour) this.withdraw();
    const held = this.plans.get(plan.contour) ?? [];
    this.asked.set(plan, this.question(plan));
    if (held.length && held[0].revision < plan.revision) {
      this.remember(plan.contour, held);
      this.plans.set(plan.contour, [plan]);
    } else {
      const others = held.filter((each) => each.name !== plan.name);
      this.plans.set(
        plan.contour,
        [...others, plan].sort((a, b) => a.s[0] - b.s[0]),
      );
    }
    this.nopaths.delete(plan.contour);
  }

  /**
   * Keep the plans before a change for comparison; during a drag, those before it, not its drafts.
   * @param {string} contour
   * @param {PlanMessage[]} held
   */
  remember(contour, held) {
    if (held.every(({ passed }) => passed !== null) || !this.before.has(contour))
      this.before.set(contour, held);
  }

  /**
   * Return a key of the options that decide the meaning of a plan's cost.
   * @param {PlanMessage} plan
   * @param {{metric?: string, objective?: string}} [options]  default: of the job
   */
  question(plan, { metric, objective } = this.job?.values?.plan ?? {}) {
    return `${metric} ${objective} ${plan.weights.map((weight) => weight.toPrecision(6))}`;
  }

  /**
   * Whether the costs of a contour now and before can be compared.
   * @param {string} contour
   */
  comparable(contour) {
    const both = [this.plans.get(contour)?.[0], this.before.get(contour)?.[0]];
    const [now, before] = both.map((plan) => plan && this.asked.get(plan));
    return now !== undefined && now === before;
  }

  /**
   * Return the distances along a plan, or null if they are not known yet.
   * @param {PlanMessage} plan
   */
  clearanceOf(plan) {
    const known = this.clearances.get(plan.name);
    const fits = known?.contour === plan.contour && known.pair.length === plan.time.length;
    return fits && known.revision >= plan.revision ? known : null;
  }

  /** @param {NoPathMessage} answer */
  takeNoPath(answer) {
    if (this.candidate?.contour === answer.contour) this.withdraw();
    const held = this.plans.get(answer.contour);
    if (held) this.remember(answer.contour, held);
    this.plans.delete(answer.contour);
    this.nopaths.set(answer.contour, answer);
    this.emit("plan", answer);
  }

  /** Forget the data of contours or joints that the job no longer has; choose a contour it has. */
  dropMissing() {
    const names = new Set(this.contours());
    if (this.candidate && !names.has(this.candidate.contour)) this.withdraw();
    for (const known of [this.plans, this.before, this.nopaths, this.maps])
      for (const name of [...known.keys()]) if (!names.has(name)) known.delete(name);
    for (const known of [this.plans, this.before])
      for (const [name, [plan]] of [...known]) if (!this.fits(plan)) known.delete(name);
    if (this.selected === null || !names.has(this.selected))
      this.select(this.contours()[0] ?? null);
    const come = this.scene?.contours.find(({ loop }) => loop === this.awaited);
    if (come) {
      this.awaited = null;
      this.select(come.name);
    }
  }
}
