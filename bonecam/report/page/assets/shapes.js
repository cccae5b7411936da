// The views of fit, levels and leftovers.
function levelMesh(k, colours, options) {
  const level = page.facts.levels[k];
  return surface(page.arrays[`level_${k}`], page.arrays[level.faces], colours, options);
}

const shownLevel = (state) => Math.min(state.level, page.facts.levels.length - 1);

function levelTitle(k) {
  const last = page.facts.levels.length - 1;
  const level = page.facts.levels[k];
  if (last === 0) return level.name[0].toUpperCase() + level.name.slice(1);
  return k === 0 || !level.limit ? `Level ${k}: ${level.name}` : `Level ${k} of ${last}: ${level.name}`;
}

function levelWords(k) {
  const level = page.facts.levels[k];
  if (k === 0 || !level.limit) return "";
  const proof = level.certified === true ? "; certified everywhere" : "";
  return `cut ${k}: at most ${number(level.limit)} mm deep; measured ${number(level.deepest, 3)} at most, ${number(level.mean, 3)} on average${proof}`;
}

function largest(values) {
  let found = 0;
  for (const value of values) found = Math.max(found, Math.abs(value));
  return found;
}

const fitMode = {
  name: "Fit",
  available: () => Boolean(page.arrays.deviation),
  build(state) {
    const a = page.arrays;
    const most = Math.max(largest(a.deviation), largest(a.given_deviation));
    const range = Math.max(Math.ceil(most * 100) / 100, 0.01);
    const given = surface(a.given, a.given_faces, coloursOf(a.given_deviation, "signed", -range, range));
    const fitted = levelMesh(0, coloursOf(a.deviation, "signed", -range, range));
    const shift = 0.68 * (page.part.high.x - page.part.low.x) + 1.5;
    const right = page.orbit.rightOfView;
    given.position.copy(right).multiplyScalar(-shift);
    fitted.position.copy(right).multiplyScalar(shift);
    page.content.add(given, fitted);
    page.labels = [["the mesh " + page.facts.given, given, page.part.high.z], ["the fitted surface", fitted, page.part.high.z]];
    showLegend({ title: "Deviation", unit: "mm", scale: "signed", low: -range, high: range,
      note: "positive: the fitted surface lies outside of the mesh" });
  },
  controls: (state) => [
    make("p", "How the mesh became one smooth surface."),
    make("p", `largest deviation ${number(page.facts.report.surface.deviation_max_mm, 3)} mm, rms ${number(page.facts.report.surface.deviation_rms_mm, 3)} mm, ${page.facts.report.surface.control_points} control points`),
  ],
};

const levelsMode = {
  name: "Levels",
  build(state) {
    const k = shownLevel(state);
    const deepest = Math.max(...page.facts.levels.map((level) => level.limit));
    if (state.open) {
      const last = page.facts.levels.length - 1;
      for (let j = 0; j <= k; j++) {
        const colour = colourAt("viridis", last ? j / last : 0);
        const mesh = levelMesh(j, null, {});
        mesh.material.color.setRGB(...colour);
        mesh.material.clippingPlanes = [CLIP];
        page.content.add(mesh);
      }
      showLegend({ title: "Level, from the part to the stock", scale: "viridis", low: 0, high: last, digits: 0 });
      return;
    }
    const cut = page.facts.levels[k].limit > 0;
    page.content.add(levelMesh(k, cut ? coloursOf(page.arrays[`depth_${k}`], "viridis", 0, deepest) : null));
    showLegend(cut ? { title: "Depth of the cut", unit: "mm", scale: "viridis", low: 0, high: deepest } : null);
  },
  available: () => page.facts.levels.length > 1,
  controls: (state) => [
    make("p", levelTitle(shownLevel(state)), "big"),
    slider("level", "from the part (0) to the stock", 0, page.facts.levels.length - 1, shownLevel(state), (value) => change({ level: value })),
    make("p", levelWords(shownLevel(state))),
    check("open", "cut open, with all levels inside", state.open, (value) => change({ open: value })),
  ],
};

const leftMode = {
  name: "Leftover",
  available: () => Boolean(page.arrays.left || page.arrays.uncut),
  build(state) {
    const a = page.arrays;
    const bent = state.bent && a.left_bent;
    const range = bent ? page.facts.left.bent : 0.1;
    page.content.add(a.left ? surface(a.left, a.left_faces, coloursOf(bent ? a.left_bent : a.left_height, "left", 0, range)) : levelMesh(0));
    const reasons = page.facts.uncut ? page.facts.uncut.reasons : [];
    if (state.uncut && a.uncut) page.content.add(uncutPoints(a, state.outer));
    const items = reasons.map((reason, k) => [KIND_COLOURS[(k + 3) % 7], `${reason.why}: ${reason.on_part} on the part`]);
    const title = bent ? "Error that bending keeps" : "Material left on the part";
    if (a.left && !state.uncut) showLegend({ title, unit: "mm", scale: "left", low: 0, high: range, digits: bent ? 3 : 2 });
    else showLegend({ title: "Contacts left uncut, and why", items });
  },
  controls: (state) => {
    const left = page.facts.left;
    const words = left
      ? `${number(left.area, 1)} mm² keep more than ${left.over} mm, ${number(Math.max(left.highest, 0))} mm at most; at the post ${number(left.post_area, 1)} mm²`
      : "the removal of material was not simulated";
    return [
      make("p", "What stays on the part", "big"),
      make("p", words),
      ...(page.arrays.left_bent ? [check("bent", "error that bending keeps, up to what 99 % stay below", state.bent, (value) => change({ bent: value }))] : []),
      ...(page.arrays.uncut ? [check("uncut", "contacts that were left out", state.uncut, (value) => change({ uncut: value }))] : []),
      ...(state.uncut && levelsMode.available() ? [check("outer", "those of outer levels too", state.outer, (value) => change({ outer: value }))] : []),
    ];
  },
};

function uncutPoints(a, outer) {
  const chosen = [];
  for (let i = 0; i < a.uncut_level.length; i++) if (outer || a.uncut_level[i] === 0) chosen.push(i);
  const positions = new Float32Array(3 * chosen.length), colours = new Float32Array(3 * chosen.length);
  chosen.forEach((i, n) => {
    positions.set(a.uncut.subarray(3 * i, 3 * i + 3), 3 * n);
    colours.set(rgb(KIND_COLOURS[(a.uncut_reason[i] + 3) % 7]), 3 * n);
  });
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  return new THREE.Points(geometry, new THREE.PointsMaterial({ size: 3.5, sizeAttenuation: false, vertexColors: true }));
}
