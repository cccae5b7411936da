// The cones of free tool axes: apex at the ball's centre, drawn to a slant length.
const CONE_SIDES = 32, MOST_CONES = 40, CONE_SHARE = 0.08, CONE_PLAYED = 14;

const coneOf = (i) => (page.arrays.move_cone ? page.arrays.move_cone[i] - 1 : -1);
const coneLength = () => CONE_SHARE * page.part.low.distanceTo(page.part.high);
const axisOf = (array, i) => new THREE.Vector3(array[3 * i], array[3 * i + 1], array[3 * i + 2]).normalize();

function ballOf(i) {
  const a = page.arrays;
  const tool = page.facts.tools.find((one) => one.number === a.move_tool[i]);
  const tip = new THREE.Vector3(a.move_tip[3 * i], a.move_tip[3 * i + 1], a.move_tip[3 * i + 2]);
  return tip.addScaledVector(axisOf(a.move_axis, i), tool.radius);
}

// An elliptic cone: the direction of its largest opening, the one across it, and the tangents of both semi-angles.
function coneFrame(k) {
  const a = page.arrays, axis = axisOf(a.cone_axis, k), x = axisOf(a.cone_side, k);
  return { axis, x, y: axis.clone().cross(x), wide: Math.tan(a.cone_angle[2 * k]), narrow: Math.tan(a.cone_angle[2 * k + 1]) };
}

function conePoints(i, length, put) {
  const apex = ballOf(i), cone = coneFrame(coneOf(i));
  const rim = (n) => {
    const turn = (2 * Math.PI * n) / CONE_SIDES;
    const towards = cone.axis.clone().addScaledVector(cone.x, cone.wide * Math.cos(turn)).addScaledVector(cone.y, cone.narrow * Math.sin(turn));
    return apex.clone().addScaledVector(towards.normalize(), length);
  };
  for (let n = 0; n < CONE_SIDES; n++) put(apex, rim(n), rim(n + 1));
}

// The cones of some moves, and the axis that each move has in its own.
function conesOf(moves, length) {
  const shown = moves.filter((i) => coneOf(i) >= 0);
  const walls = [], edges = [], rims = [];
  for (const i of shown) {
    conePoints(i, length, (apex, one, next) => { walls.push(...apex.toArray(), ...one.toArray(), ...next.toArray()); rims.push(...one.toArray(), ...next.toArray()); });
    const apex = ballOf(i);
    edges.push(...apex.toArray(), ...apex.clone().addScaledVector(axisOf(page.arrays.move_axis, i), 1.25 * length).toArray());
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(walls), 3));
  const material = new THREE.MeshBasicMaterial({ color: new THREE.Color("#cc79a7"), transparent: true, opacity: 0.3, side: THREE.DoubleSide, depthWrite: false });
  const group = new THREE.Group();
  group.name = "cones";
  group.add(new THREE.Mesh(geometry, material), plainLines(rims, "#8d3f6d"), plainLines(edges, "#d55e00"));
  return group;
}

function plainLines(positions, colour) {
  const colours = new Float32Array(positions.length);
  for (let n = 0; n < positions.length; n += 3) colours.set(rgb(colour), n);
  return lines(new Float32Array(positions), colours);
}

// Cuts of a level, evenly chosen, that have a cone.
function someCones(moves) {
  const cuts = moves.filter((i) => page.arrays.move_kind[i] === 0 && coneOf(i) >= 0);
  const every = Math.max(1, Math.ceil(cuts.length / MOST_CONES));
  return cuts.filter((_, n) => n % every === Math.floor(every / 2));
}

function coneWords(i) {
  const k = coneOf(i);
  if (k < 0) return "no certified cone here: this axis was tested alone";
  const cone = coneFrame(k), axis = axisOf(page.arrays.move_axis, i);
  const off = Math.hypot(axis.dot(cone.x) / cone.wide, axis.dot(cone.y) / cone.narrow) / axis.dot(cone.axis);
  const inside = off >= 0 && off <= 1 ? `this axis at ${number(100 * off, 0)} % of the way to its edge` : "this axis lies outside and was tested alone";
  return `certified cone of free axes: half-angles ${coneAngles(k)} degrees, ${inside}`;
}

function coneAngles(k) {
  return [0, 1].map((n) => number((page.arrays.cone_angle[2 * k + n] * 180) / Math.PI, 1)).join(" x ");
}
