// Meshes of the scene: surfaces with colours, bodies of revolution, the tool.
const CLIP = new THREE.Plane(new THREE.Vector3(0, 1, 0), 0);

function surface(positions, faces, colours, options = {}) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(faces, 1));
  if (colours) geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  geometry.computeVertexNormals();
  const material = new THREE.MeshPhongMaterial({
    color: colours ? 0xffffff : new THREE.Color(options.colour || BONE),
    vertexColors: Boolean(colours),
    shininess: colours ? 5 : 18,
    specular: colours ? 0x080808 : 0x222222,
    side: THREE.DoubleSide,
    transparent: options.opacity !== undefined,
    opacity: options.opacity === undefined ? 1 : options.opacity,
    depthWrite: options.opacity === undefined,
    polygonOffset: true,
    polygonOffsetFactor: options.opacity === undefined ? 1 : 4, // what is seen through lies behind what it touches
    polygonOffsetUnits: 1,
  });
  return new THREE.Mesh(geometry, material);
}

// A body about Z: pieces are [bottom, top, radius, top radius].
function revolved(pieces, colour, opacity) {
  const group = new THREE.Group();
  const material = new THREE.MeshPhongMaterial({
    color: new THREE.Color(colour), shininess: 30, specular: 0x333333,
    transparent: opacity !== undefined, opacity: opacity === undefined ? 1 : opacity, depthWrite: opacity === undefined,
  });
  for (const [bottom, top, radius, topRadius, x = 0, y = 0] of pieces) {
    const shape = new THREE.CylinderGeometry(topRadius, radius, top - bottom, 48);
    shape.rotateX(Math.PI / 2);
    shape.translate(x, y, (bottom + top) / 2);
    group.add(new THREE.Mesh(shape, material));
  }
  return group;
}

// The post up to its top, waisted by the groove that parts it.
function postPieces(post, top) {
  const groove = page.facts.report.parting;
  if (!groove) return [[0, top, post.radius, post.radius]];
  const half = groove.width_mm / 2, count = 24;
  const rings = Array.from({ length: count + 1 }, (_, n) => {
    const angle = Math.PI * (n / count - 0.5);
    return [groove.z_mm + half * Math.sin(angle), Math.min(post.radius, groove.bridge_diameter_mm / 2 + half * (1 - Math.cos(angle)))];
  });
  const all = [[0, post.radius], ...rings, [post.top, post.radius]];
  return all.slice(1).map(([z, radius], n) => [all[n][0], z, all[n][1], radius]);
}

// The cutter in holder and spindle, its tip in the origin, its axis Z.
function toolBody(tool) {
  const group = new THREE.Group();
  const ball = new THREE.SphereGeometry(tool.radius, 32, 16);
  ball.translate(0, 0, tool.radius);
  const looks = { cutter: ["#e69f00"], shank: [METAL], holder: ["#6b7785", 0.55], spindle: ["#8b95a1", 0.25] };
  group.add(new THREE.Mesh(ball, new THREE.MeshPhongMaterial({ color: new THREE.Color(looks.cutter[0]), shininess: 60 })));
  for (const [name, start, end, radius, endRadius] of tool.sections) {
    const body = revolved([[start, end, radius, endRadius]], ...looks[name]);
    body.name = name;
    group.add(body);
  }
  return group;
}

function tableBody(table) {
  const material = new THREE.MeshPhongMaterial({ color: new THREE.Color("#cfd6de"), shininess: 10, transparent: true, opacity: 0.8 });
  const group = new THREE.Group();
  const thick = 8;
  let shape;
  if (table.radius !== null) {
    shape = new THREE.CylinderGeometry(table.radius, table.radius, thick, 96);
    shape.rotateX(Math.PI / 2);
  } else {
    shape = new THREE.BoxGeometry(2 * (table.half_width || 150), 2 * (table.half_depth || 150), thick);
  }
  shape.translate(0, 0, -thick / 2 - 0.02);
  group.add(new THREE.Mesh(shape, material));
  let height = 0;
  const pieces = table.standing.map(([length, radius, top]) => [height, (height += length), radius, top]);
  if (pieces.length) group.add(revolved(pieces, "#aab4be"));
  return group;
}

function lines(positions, colours, opacity) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  const material = new THREE.LineBasicMaterial({ vertexColors: true, transparent: opacity !== undefined, opacity: opacity || 1 });
  return new THREE.LineSegments(geometry, material);
}

// X, Y and Z at the program's zero.
function zeroMark(size) {
  const ends = [[1, 0, 0, "#d55e00"], [0, 1, 0, "#009e73"], [0, 0, 1, "#0072b2"]];
  const positions = new Float32Array(18), colours = new Float32Array(18);
  ends.forEach(([x, y, z, colour], k) => {
    positions.set([0, 0, 0, x * size, y * size, z * size], 6 * k);
    colours.set([...rgb(colour), ...rgb(colour)], 6 * k);
  });
  return lines(positions, colours);
}

function dispose(object) {
  object.traverse((item) => {
    if (item.geometry) item.geometry.dispose();
    if (item.material) item.material.dispose();
  });
}
