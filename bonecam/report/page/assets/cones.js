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

function conePoints(i, length, put) {
  const a = page.arrays, k = coneOf(i);
  const apex = ballOf(i), axis = axisOf(a.cone_axis, k), angle = a.cone_angle[k];
  const side = new THREE.Vector3(1, 0, 0);
  if (Math.abs(axis.x) > 0.7) side.set(0, 1, 0);
  const x = side.cross(axis).normalize();
  const y = axis.clone().cross(x);
  const rim = (n) => {
    const turn = (2 * Math.PI * n) / CONE_SIDES;
    return apex.clone().addScaledVector(axis, length * Math.cos(angle))
      .addScaledVector(x, length * Math.sin(angle) * Math.cos(turn)).addScaledVector(y, length * Math.sin(angle) * Math.sin(turn));
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
  geometry.addAttribute("position", new THREE.BufferAttribute(new Float32Array(walls), 3));
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
  const degrees = 180 / Math.PI;
  const off = axisOf(page.arrays.cone_axis, k).angleTo(axisOf(page.arrays.move_axis, i));
  const room = page.arrays.cone_angle[k] - off;
  const inside = room >= 0 ? `${number(room * degrees, 1)} degrees inside its edge` : "this axis lies outside and was tested alone";
  return `certified cone of free axes: half-angle ${number(page.arrays.cone_angle[k] * degrees, 1)} degrees, ${inside}`;
}
