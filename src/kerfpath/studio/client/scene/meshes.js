/** Meshes from the server, prepared for drawing: creased normals, sharp edges, merged by body. */

import { BufferAttribute, BufferGeometry } from "three";

/**
 * @typedef {object} Triangles
 * @property {Float32Array} xyz  nv 3, m
 * @property {Uint32Array} corners  nt 3
 */

/** @type {Map<string, Promise<Triangles>>} a mesh never changes */
const fetched = new Map();

/**
 * Return a mesh of the server.
 * @param {string} id
 * @returns {Promise<Triangles>}
 */
export function mesh(id) {
  let known = fetched.get(id);
  if (!known) {
    known = fetch(`mesh/${encodeURIComponent(id)}${location.search}`).then(async (answer) => {
      if (!answer.ok) throw new Error(`the mesh ${id} is not there (${answer.status})`);
      return unpack(await answer.arrayBuffer());
    });
    known.catch(() => fetched.delete(id));
    fetched.set(id, known);
  }
  return known;
}

/**
 * Return the triangles of a /mesh answer.
 * @param {ArrayBuffer} bytes
 * @returns {Triangles}
 */
function unpack(bytes) {
  const [nv, nt] = new Uint32Array(bytes, 0, 2);
  const xyz = new Float32Array(bytes, 8, 3 * nv);
  return { xyz, corners: new Uint32Array(bytes, 8 + 12 * nv, 3 * nt) };
}

/**
 * Return several meshes merged into one.
 * @param {Triangles[]} several
 * @returns {Triangles}
 */
export function merged(several) {
  if (several.length === 1) return several[0];
  const xyz = new Float32Array(several.reduce((sum, each) => sum + each.xyz.length, 0));
  const corners = new Uint32Array(several.reduce((sum, each) => sum + each.corners.length, 0));
  let [v, c] = [0, 0];
  for (const each of several) {
    xyz.set(each.xyz, v);
    for (let i = 0; i < each.corners.length; i++) corners[c + i] = each.corners[i] + v / 3;
    v += each.xyz.length;
    c += each.corners.length;
  }
  return { xyz, corners };
}

/**
 * Return for each vertex the number of its position; vertices at one position have the same number.
 * @param {Float32Array} xyz
 * @returns {Int32Array}
 */
function places(xyz) {
  const count = xyz.length / 3;
  const size = 2 ** Math.ceil(Math.log2(2 * count + 2));
  const table = new Int32Array(size).fill(-1);
  const place = new Int32Array(count);
  const grid = 1e6; // vertices within a thousandth of a millimetre are one
  for (let i = 0; i < count; i++) {
    const [x, y, z] = [0, 1, 2].map((a) => Math.round(xyz[3 * i + a] * grid) | 0);
    let slot = (Math.imul(x, 73856093) ^ Math.imul(y, 19349663) ^ Math.imul(z, 83492791)) >>> 0;
    for (slot &= size - 1; ; slot = (slot + 1) & (size - 1)) {
      const other = table[slot];
      if (other < 0) {
        table[slot] = place[i] = i;
        break;
      }
      const same = [x, y, z].every((value, a) => Math.round(xyz[3 * other + a] * grid) === value);
      if (same) {
        place[i] = other;
        break;
      }
    }
  }
  return place;
}

/**
 * Return a geometry with normals that are smooth except across edges sharper than the crease, and
 * these edges as pairs of points.
 * @param {Triangles} triangles
 * @param {number} [crease]  rad
 * @returns {{faces: BufferGeometry, edges: Float32Array}}
 */
export function creased({ xyz, corners }, crease = 0.6) {
  const count = corners.length / 3;
  const place = places(xyz);
  const normals = new Float32Array(3 * count); // as long as twice the area
  /** @type {number[][]} the triangles around each place */
  const around = [];
  for (let t = 0; t < count; t++) {
    const [a, b, c] = [0, 1, 2].map((i) => 3 * corners[3 * t + i]);
    const [ux, uy, uz] = [0, 1, 2].map((i) => xyz[b + i] - xyz[a + i]);
    const [vx, vy, vz] = [0, 1, 2].map((i) => xyz[c + i] - xyz[a + i]);
    normals.set([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], 3 * t);
    for (let i = 0; i < 3; i++) (around[place[corners[3 * t + i]]] ??= []).push(t);
  }
  const limit = Math.cos(crease);
  const alike = (/** @type {number} */ s, /** @type {number} */ t) => {
    let [dot, ss, tt] = [0, 0, 0];
    for (let i = 0; i < 3; i++) {
      const [n, m] = [normals[3 * s + i], normals[3 * t + i]];
      dot += n * m;
      ss += n * n;
      tt += m * m;
    }
    return dot >= limit * Math.sqrt(ss * tt);
  };
  const position = new Float32Array(9 * count);
  const normal = new Float32Array(9 * count);
  /** @type {number[]} */
  const edges = [];
  for (let t = 0; t < count; t++) {
    for (let i = 0; i < 3; i++) {
      const vertex = corners[3 * t + i];
      const out = 9 * t + 3 * i;
      let [x, y, z] = [0, 0, 0];
      for (const s of around[place[vertex]]) {
        if (s !== t && !alike(s, t)) continue;
        x += normals[3 * s];
        y += normals[3 * s + 1];
        z += normals[3 * s + 2];
      }
      const length = Math.hypot(x, y, z) || 1;
      normal.set([x / length, y / length, z / length], out);
      position.set(xyz.subarray(3 * vertex, 3 * vertex + 3), out);
      const next = corners[3 * t + ((i + 1) % 3)];
      const beside = across(t, place[vertex], place[next]);
      if (beside === -1 || (beside > t && !alike(beside, t)))
        edges.push(
          ...xyz.subarray(3 * vertex, 3 * vertex + 3),
          ...xyz.subarray(3 * next, 3 * next + 3),
        );
    }
  }
  const faces = new BufferGeometry();
  faces.setAttribute("position", new BufferAttribute(position, 3));
  faces.setAttribute("normal", new BufferAttribute(normal, 3));
  return { faces, edges: new Float32Array(edges) };

  /**
   * Return the triangle beyond an edge of triangle t, or -1.
   * @param {number} t
   * @param {number} from
   * @param {number} to
   */
  function across(t, from, to) {
    for (const s of around[from])
      if (s !== t && [0, 1, 2].some((i) => place[corners[3 * s + i]] === to)) return s;
    return -1;
  }
}
