"use strict";
(async function () {
  const element = (id) => document.getElementById(id);
  const made = (name, text, className) => {
    const node = document.createElement(name);
    if (text !== undefined) node.textContent = text;
    if (className) node.className = className;
    return node;
  };
  const say = (text) => { element("said").textContent = text; };
  window.addEventListener("error", (event) => { document.body.dataset.error = event.message; });
  window.addEventListener("unhandledrejection", (event) => { document.body.dataset.error = String(event.reason); });

  // ---- what was drawn --------------------------------------------------------------------------------------------
  const shown = JSON.parse(element("document").textContent);
  const packed = Uint8Array.from(atob(element("block").textContent), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const block = await new Response(stream).arrayBuffer();
  const placesOf = (item) => {
    const [first, count] = item.at, steps = new Uint16Array(block, first, count), result = new Float32Array(count);
    for (let k = 0; k < count; k++) result[k] = item.low[k % 3] + item.step[k % 3] * steps[k];
    return result;
  };
  const groupOf = (path) => path.split("/")[0];
  const same = (a, b) => a.replaceAll(" ", "_") === b.replaceAll(" ", "_");
  document.title = shown.name;
  element("name").textContent = shown.name;
  element("note").textContent = shown.left_out.length ? "Left out: " + shown.left_out.join(", ") + "." : "";

  // ---- state, and the address that holds it ------------------------------------------------------------------------
  const [low, high] = shown.bounds;
  const middle = low.map((value, k) => (value + high[k]) / 2);
  const extent = Math.max(0.02, Math.hypot(...low.map((value, k) => high[k] - value)));
  const start = { eye: [-2.11, 0.825, extent], target: middle, time: null, off: [], fade: {}, joints: {}, chosen: "", trust: false };
  const state = structuredClone(start);
  const number = (value) => typeof value === "number" && Number.isFinite(value);
  function readAddress() {
    try {
      const given = JSON.parse(decodeURIComponent(location.hash.slice(1)));
      if (Array.isArray(given.eye) && given.eye.length === 3 && given.eye.every(number)) state.eye = given.eye;
      if (Array.isArray(given.target) && given.target.length === 3 && given.target.every(number)) state.target = given.target;
      if (number(given.time)) state.time = given.time;
      if (Array.isArray(given.off)) state.off = given.off.filter((name) => typeof name === "string");
      for (const key of ["fade", "joints"])
        for (const [name, value] of Object.entries(given[key] || {})) if (number(value)) state[key][name] = value;
      if (typeof given.chosen === "string") state.chosen = given.chosen;
      state.trust = given.trust === true;
      return true;
    } catch { return false; }
  }
  const addressOf = () => "#" + encodeURIComponent(JSON.stringify(state));
  let later = 0;
  function remember() {
    clearTimeout(later);
    later = setTimeout(() => { try { history.replaceState(null, "", addressOf()); } catch { /* shown within another page */ } }, 200);
  }

  // ---- the picture -------------------------------------------------------------------------------------------------
  const canvas = element("picture");
  let renderer = null;
  const probe = document.createElement("canvas");  // three.js would complain in the console
  if (probe.getContext("webgl2") || probe.getContext("webgl"))
    try { renderer = new THREE.WebGLRenderer({ canvas, antialias: true }); } catch { renderer = null; }
  const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(45, 1, Math.min(0.02, 0.02 * extent), Math.max(5, 20 * extent));
  camera.up.set(0, 0, 1);
  scene.background = new THREE.Color(0xf3f1ec);
  scene.add(new THREE.HemisphereLight(0xffffff, 0x9a958c, 0.75));
  const lamp = new THREE.DirectionalLight(0xffffff, 0.45);
  scene.add(lamp);
  const things = [];       // {object, path, time, kind, labels}
  const add = (object, item, kind) => {
    object.matrixAutoUpdate = false;
    scene.add(object);
    things.push({ object, path: item.path, time: item.time, kind, item });
  };
  const colorsOf = (entry) => new THREE.BufferAttribute(new Uint8Array(block, entry[0], entry[1]), 3, true);
  const fading = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
  for (const item of shown.meshes) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(placesOf(item), 3));
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(block, item.faces[0], item.faces[1]), 1));
    if (item.colors) geometry.setAttribute("color", colorsOf(item.colors));
    geometry.computeVertexNormals();
    if (item.parts) item.of = new Uint32Array(block, item.parts[0], item.parts[1]);
    const side = item.front ? THREE.FrontSide : THREE.DoubleSide;
    const color = item.colors ? 0xffffff : 0xb8b4ac;
    add(new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color, vertexColors: !!item.colors, side, ...fading })), item, "mesh");
  }
  for (const item of shown.points) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(placesOf(item), 3));
    if (item.colors) geometry.setAttribute("color", colorsOf(item.colors));
    const color = item.colors ? 0xffffff : 0x444444;
    add(new THREE.Points(geometry, new THREE.PointsMaterial({ size: 2 * item.radius, color, vertexColors: !!item.colors })), item, "points");
  }
  const segments = (points, colors) => {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(points), 3));
    if (colors) geometry.setAttribute("color", new THREE.BufferAttribute(new Uint8Array(colors), 3, true));
    return geometry;
  };
  for (const item of shown.lines) {
    const places = placesOf(item), points = [], colors = [];
    let first = 0;
    item.ends = [];
    item.lengths.forEach((length, k) => {
      for (let j = first; j + 1 < first + length; j++) {
        points.push(...places.slice(3 * j, 3 * j + 6));
        colors.push(...item.colors[k], ...item.colors[k]);
      }
      item.ends.push([...places.slice(3 * first, 3 * (first + length))]);
      first += length;
    });
    add(new THREE.LineSegments(segments(points, colors), new THREE.LineBasicMaterial({ vertexColors: true })), item, "line");
  }
  const EDGES = [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];
  const boxes = [];        // {label, corners (8 x 3), path, time}
  for (const item of shown.boxes) {
    const places = placesOf(item), points = [], colors = [];
    item.labels.forEach((label, k) => {
      const corner = (j) => [...places.slice(3 * (8 * k + j), 3 * (8 * k + j) + 3)];
      boxes.push({ label, corners: [0, 1, 2, 3, 4, 5, 6, 7].map(corner), path: item.path });
      for (const [a, b] of EDGES) { points.push(...corner(a), ...corner(b)); colors.push(...item.colors[k], ...item.colors[k]); }
    });
    add(new THREE.LineSegments(segments(points, colors), new THREE.LineBasicMaterial({ vertexColors: true })), item, "boxes");
  }

  // ---- time and places -----------------------------------------------------------------------------------------------
  const timed = [...things, ...shown.transforms, ...shown.pictures, ...shown.documents].map((item) => item.time).filter(number);
  const first = timed.reduce((a, b) => Math.min(a, b), Infinity), last = timed.reduce((a, b) => Math.max(a, b), -Infinity);
  const moments = [...shown.moments].sort((a, b) => a.time - b.time);
  const byPath = (items) => {
    const found = new Map();
    for (const item of items) { if (!found.has(item.path)) found.set(item.path, []); found.get(item.path).push(item); }
    for (const list of found.values()) list.sort((a, b) => (a.time ?? -Infinity) - (b.time ?? -Infinity));
    return found;
  };
  const latest = (list, time) => {
    let best = null;
    for (const item of list) { if (number(item.time) && item.time > time) break; best = item; }
    return best;
  };
  const drawnAt = byPath(things), placedAt = byPath(shown.transforms);
  const matrixOf = (rows) => new THREE.Matrix4().set(...rows, 0, 0, 0, 1);
  const tried = new Map(); // path of a link -> Matrix4 while joints are tried
  function placeOf(path, time) {
    const whole = new THREE.Matrix4(), parts = path.split("/");
    for (let k = 1; k <= parts.length; k++) {
      const prefix = parts.slice(0, k).join("/");
      if (tried.has(prefix)) whole.multiply(tried.get(prefix));
      else if (placedAt.has(prefix)) { const found = latest(placedAt.get(prefix), time); if (found) whole.multiply(matrixOf(found.rows)); }
    }
    return whole;
  }
  function tryJoints() {
    tried.clear();
    if (!Object.keys(state.joints).length) return;
    for (const link of shown.joints) {
      const pose = tried.has(link.parent) ? tried.get(link.parent).clone() : new THREE.Matrix4();
      pose.multiply(matrixOf(link.parent_from_link));
      const value = state.joints[link.name] ?? link.value, axis = new THREE.Vector3(...link.axis);
      if (link.kind === "turning") pose.multiply(new THREE.Matrix4().makeRotationAxis(axis.normalize(), value));
      if (link.kind === "sliding") pose.multiply(new THREE.Matrix4().makeTranslation(...axis.multiplyScalar(value).toArray()));
      tried.set(link.path, pose);
    }
  }
  function arrange() {
    const time = state.time ?? first;
    tryJoints();
    for (const [path, list] of drawnAt) {
      const now = latest(list, time), place = placeOf(path, time);
      for (const thing of list) {
        const opacity = state.fade[groupOf(path)] ?? 1;
        thing.object.visible = (thing === now || list.length === 1 && !number(thing.time) || thing.kind !== now?.kind && !number(thing.time))
          && opacity > 0 && !state.off.some((hidden) => path === hidden || path.startsWith(hidden + "/"));
        thing.object.matrix.copy(place);
        thing.object.matrixWorldNeedsUpdate = true;
        thing.object.material.opacity = opacity;
        thing.object.material.transparent = opacity < 1;
        thing.object.material.depthWrite = opacity >= 1;
      }
    }
    if (timed.length) { element("moment").value = time; element("clock").textContent = (time - first).toFixed(2) + " s"; }
    const happening = element("happening"), begun = moments.filter((moment) => moment.time <= time + 1e-9);
    const latestOnes = begun.filter((moment) => moment.time === begun[begun.length - 1].time);
    happening.textContent = (latestOnes.some((one) => one.bad) ? latestOnes.filter((one) => one.bad) : latestOnes).map((one) => one.text).join("; ");
    happening.classList.toggle("bad", latestOnes.some((one) => one.bad));
    for (const [image, list] of images) {
      const found = latest(list, time);
      if (found && image.src !== found.address) image.src = found.address;
      image.hidden = !image.src;
    }
    draw();
  }
  function look() {
    const [yaw, pitch, far] = state.eye, flat = far * Math.cos(pitch);
    camera.position.set(state.target[0] + flat * Math.cos(yaw), state.target[1] + flat * Math.sin(yaw), state.target[2] + far * Math.sin(pitch));
    camera.lookAt(...state.target);
    lamp.position.copy(camera.position);
  }
  let asked = false;
  function draw() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      const width = canvas.clientWidth || 300, height = canvas.clientHeight || 200;
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
      look();
      if (renderer) {
        renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
        renderer.setSize(width, height, false);
        renderer.render(scene, camera);
      } else paint(width, height);
      document.body.dataset.drawn = Number(document.body.dataset.drawn || 0) + 1;
    });
  }
  // Without WebGL: the vertices as squares, the farthest first.
  function paint(width, height) {
    canvas.width = width; canvas.height = height;
    const context = canvas.getContext("2d");
    context.fillStyle = "#f3f1ec"; context.fillRect(0, 0, width, height);
    camera.updateMatrixWorld();
    const dots = [], point = new THREE.Vector3();
    for (const { object, kind } of things) {
      if (!object.visible || kind === "line" || kind === "boxes") continue;
      const places = object.geometry.attributes.position, paint = object.geometry.attributes.color;
      for (let k = 0; k < places.count; k += Math.max(1, Math.ceil(places.count / 60000))) {
        point.fromBufferAttribute(places, k).applyMatrix4(object.matrix).project(camera);
        if (Math.abs(point.x) > 1 || Math.abs(point.y) > 1 || Math.abs(point.z) > 1) continue;
        dots.push([point.z, (point.x + 1) * width / 2, (1 - point.y) * height / 2, paint ? [0, 1, 2].map((j) => paint.array[3 * k + j]) : [150, 150, 150]]);
      }
    }
    dots.sort((a, b) => b[0] - a[0]);
    for (const [, x, y, color] of dots) { context.fillStyle = `rgb(${color})`; context.fillRect(x - 1.5, y - 1.5, 3, 3); }
  }

  // ---- who listens: the script of a page that is served ---------------------------------------------------------------
  const listeners = new Map([["chosen", []], ["point", []]]);
  const tellListeners = (what, value) => { for (const listener of listeners.get(what)) listener(value); };

  // ---- what is chosen --------------------------------------------------------------------------------------------------
  const marked = new THREE.LineSegments(segments([]), new THREE.LineBasicMaterial({ color: 0xe07a00, depthTest: false }));
  marked.renderOrder = 10;
  marked.frustumCulled = false;
  scene.add(marked);
  const mark = (points) => { marked.geometry.dispose(); marked.geometry = segments(points); draw(); };
  // The surface of a part of a mesh, over the mesh.
  const glow = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial({ color: 0xff8a00, transparent: true, opacity: 0.5, depthWrite: false, polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -1 }));
  glow.visible = false;
  glow.matrixAutoUpdate = false;
  glow.renderOrder = 9;
  scene.add(glow);
  function light(names) {
    glow.visible = false;
    const thing = names.length && things.find(({ object, item }) => item.of && object.visible);
    if (!thing) return;
    const wanted = new Set(Object.entries(thing.item.names).filter(([, name]) => names.some((one) => same(one, name))).map(([id]) => Number(id)));
    const all = thing.object.geometry.index.array, of = thing.item.of, kept = [];
    if (wanted.size) for (let k = 0; k < all.length; k += 3) if (wanted.has(of[all[k]]) && wanted.has(of[all[k + 1]]) && wanted.has(of[all[k + 2]])) kept.push(all[k], all[k + 1], all[k + 2]);
    if (!kept.length) return;
    glow.geometry.dispose();
    glow.geometry = new THREE.BufferGeometry();
    glow.geometry.setAttribute("position", thing.object.geometry.attributes.position);
    glow.geometry.setIndex(kept);
    glow.matrix.copy(thing.object.matrix);
    glow.matrixWorldNeedsUpdate = glow.visible = true;
  }
  const frameOf = (box) => EDGES.flatMap(([a, b]) => [...box.corners[a], ...box.corners[b]]);
  function markNodes(names) {
    const found = boxes.filter((one) => names.some((name) => same(one.label, name)));
    light(names);
    mark(found.flatMap(frameOf));
    for (const { object, path, kind } of things)
      if (kind === "mesh") object.material.emissive.setHex(path.split("/").some((part) => names.some((name) => same(part, name))) ? 0x553300 : 0);
    return found[0];
  }
  // ---- what is trustworthy: colours by what is known of each thing -------------------------------------------------------
  const trusted = Object.entries(shown.trust || {});
  const doubted = (path) => {
    const parts = path.split("/").flatMap((part) => [part, part.split("__")[0]]);
    return trusted.find(([name]) => parts.some((part) => same(part, name)));
  };
  const grey = [178, 174, 168];
  function showTrust() {
    for (const thing of things) {
      if (thing.kind !== "mesh" || thing.item.of) continue;
      const { material } = thing.object;
      thing.own ??= { vertexColors: material.vertexColors, color: material.color.getHex() };
      const found = state.trust && trusted.length ? doubted(thing.path) : null;
      const vertexColors = !state.trust && thing.own.vertexColors;
      if (material.vertexColors !== vertexColors) { material.vertexColors = vertexColors; material.needsUpdate = true; }
      if (state.trust) material.color.setRGB(...(found ? found[1].color : grey).map((value) => value / 255));
      else material.color.setHex(thing.own.color);
    }
    draw();
  }
  const markNode = (name) => markNodes(name ? [name] : []);
  const labelled = shown.lines.flatMap((item) => (item.labels || []).map((text, k) => ({ text, points: item.ends[k] })));
  const relationsOf = (name) => labelled.filter(({ text }) => text.split(":")[0].split(" ").includes(name));
  function tell(relations) {
    const list = element("relations");
    list.replaceChildren();
    for (const { text, points } of relations) {
      const row = made("div", text);
      row.tabIndex = 0;
      const show = () => { const strip = []; for (let k = 0; k + 5 < points.length; k += 3) strip.push(...points.slice(k, k + 6)); mark(strip); };
      row.addEventListener("mouseenter", show);
      row.addEventListener("focus", show);
      list.append(row);
    }
  }
  function explain(name) {
    const found = Object.entries(shown.because || {}).find(([one]) => name && same(one, name));
    element("why").hidden = !found;
    element("because").replaceChildren(...(found ? found[1] : []).map((line) => made("li", line)));
  }
  function choose(name, come) {
    state.chosen = name;
    for (const button of document.querySelectorAll(".node .name")) button.classList.toggle("chosen", button.textContent === name);
    const box = markNode(name);
    tell(name ? relationsOf(name) : []);
    explain(name);
    if (box && come) {
      state.target = [0, 1, 2].map((k) => box.corners.reduce((sum, corner) => sum + corner[k], 0) / 8);
      state.eye[2] = Math.max(Math.min(0.6, extent), 3 * Math.hypot(...[0, 1, 2].map((k) => box.corners[7][k] - box.corners[0][k])));
    }
    remember(); draw();
    tellListeners("chosen", name);
  }
  const ray = new THREE.Raycaster();
  let measuring = null;
  function hitAt(event) {
    const frame = canvas.getBoundingClientRect();
    look(); camera.updateMatrixWorld();
    ray.setFromCamera({ x: 2 * (event.clientX - frame.left) / frame.width - 1, y: 1 - 2 * (event.clientY - frame.top) / frame.height }, camera);
    const solid = things.filter(({ object, kind }) => kind === "mesh" && object.visible).map(({ object }) => object);
    for (const object of solid) object.updateMatrixWorld(true);
    return ray.intersectObjects(solid, false)[0];
  }
  const within = (box, point) => {
    const low = [0, 1, 2].map((k) => Math.min(...box.corners.map((corner) => corner[k]))), high = [0, 1, 2].map((k) => Math.max(...box.corners.map((corner) => corner[k])));
    return point.every((value, k) => value >= low[k] - 0.01 && value <= high[k] + 0.01) ? high.reduce((volume, value, k) => volume * (value - low[k] + 0.01), 1) : Infinity;
  };
  function click(event) {
    const hit = hitAt(event);
    if (!hit) { say(""); choose("", false); return; }
    const point = hit.point.toArray(), place = point.map((value) => value.toFixed(3)).join(", ");
    if (measuring) {
      measuring.push(point);
      if (measuring.length === 2) {
        const [a, b] = measuring, across = Math.hypot(...a.map((value, k) => value - b[k]));
        mark([...a, ...b]);
        say(`${across.toFixed(3)} m; along x, y, z: ${a.map((value, k) => (b[k] - value).toFixed(3)).join(", ")} m`);
        measuring = null;
      } else say("and to where?");
      return;
    }
    const normal = hit.face.normal.clone().transformDirection(hit.object.matrixWorld);
    if (normal.dot(ray.ray.direction) > 0) normal.negate();
    if (listeners.get("point").some((listener) => listener(point, normal.toArray()))) return;
    const [name, path] = whatAt(hit, point);
    choose(name, false);
    say(`${name || path} at ${place} m`);
  }
  function whatAt(hit, point) {
    const { path, item } = things.find(({ object }) => object === hit.object);
    const names = shown.graph ? shown.graph.names : boxes.map((box) => box.label);
    if (item.of) {
      const found = item.names[item.of[hit.face.a]] ?? "";
      return [names.find((one) => same(one, found)) || found, found || "nothing that has a name"];
    }
    const own = names.find((name) => path.split("/").some((part) => same(part, name)));
    const around = boxes.map((box) => [within(box, point), box.label]).sort((a, b) => a[0] - b[0])[0];
    const name = own || (around && around[0] < Infinity ? around[1] : "");
    return [names.find((one) => same(one, name)) || name, path];
  }

  // ---- mouse and keys --------------------------------------------------------------------------------------------------
  const turn = (yaw, pitch) => { state.eye[0] += yaw; state.eye[1] = Math.min(1.55, Math.max(-1.55, state.eye[1] + pitch)); remember(); draw(); };
  const zoom = (factor) => { state.eye[2] = Math.min(8 * extent, Math.max(Math.min(0.05, 0.1 * extent), state.eye[2] * factor)); remember(); draw(); };
  function move(x, y) {
    look(); camera.updateMatrixWorld();
    const right = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 0), up = new THREE.Vector3().setFromMatrixColumn(camera.matrixWorld, 1);
    const step = right.multiplyScalar(-x).add(up.multiplyScalar(y)).multiplyScalar(state.eye[2] / (canvas.clientHeight || 1));
    state.target = state.target.map((value, k) => value + step.getComponent(k));
    remember(); draw();
  }
  let held = null;
  canvas.addEventListener("pointerdown", (event) => { held = { x: event.clientX, y: event.clientY, far: 0 }; canvas.setPointerCapture(event.pointerId); canvas.focus(); });
  canvas.addEventListener("pointermove", (event) => {
    if (!held) return;
    const x = event.clientX - held.x, y = event.clientY - held.y;
    held = { x: event.clientX, y: event.clientY, far: held.far + Math.abs(x) + Math.abs(y) };
    if (event.buttons & 2 || event.shiftKey) move(x, y); else turn(-0.006 * x, 0.006 * y);
  });
  canvas.addEventListener("pointerup", (event) => { const still = held && held.far < 4; held = null; if (still && event.button === 0) click(event); });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => { event.preventDefault(); zoom(Math.exp(0.001 * event.deltaY)); }, { passive: false });
  const KEYS = {
    ArrowLeft: () => turn(0.1, 0), ArrowRight: () => turn(-0.1, 0), ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
    "+": () => zoom(0.8), "-": () => zoom(1.25), f: () => fit(), " ": () => play(),
    m: () => { measuring = []; say("measure: from where?"); }, Escape: () => { measuring = null; say(""); choose("", false); },
  };
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("input, textarea, select, button, summary, a, [tabindex='0']:not(canvas)") || event.ctrlKey || event.metaKey || event.altKey) return;
    const does = KEYS[event.key] || (/^[1-9]$/.test(event.key) && shown.views[event.key - 1] ? () => open(shown.views[event.key - 1]) : null);
    if (does) { event.preventDefault(); does(); }
  });
  const fit = () => { state.eye = [...start.eye]; state.target = [...start.target]; remember(); draw(); };
  if (window !== window.parent) element("link").hidden = true;  // within another page there is no address to hold it
  element("fit").addEventListener("click", fit);
  element("link").addEventListener("click", () => {
    const link = element("address");
    link.href = addressOf(); link.hidden = false;
    try { history.replaceState(null, "", addressOf()); } catch { /* shown within another page */ }
  });
  window.addEventListener("hashchange", () => { if (readAddress()) { refresh(); showTrust(); arrange(); choose(state.chosen, false); } });
  window.addEventListener("resize", draw);

  // ---- playing -----------------------------------------------------------------------------------------------------------
  let playing = 0;
  function play() {
    if (!timed.length) return;
    if (playing) { cancelAnimationFrame(playing); playing = 0; element("play").textContent = "play"; return; }
    element("play").textContent = "stop";
    let before = performance.now();
    if ((state.time ?? first) >= last) state.time = first;
    const pace = Math.max(1, (last - first) / 60);
    const step = (now) => {
      state.time = Math.min(last, (state.time ?? first) + pace * (now - before) / 1000);
      before = now;
      arrange();
      if (state.time < last) playing = requestAnimationFrame(step);
      else { playing = 0; element("play").textContent = "play"; remember(); }
    };
    playing = requestAnimationFrame(step);
  }
  element("play").addEventListener("click", play);
  if (timed.length) {
    element("timeline").hidden = false;
    Object.assign(element("moment"), { min: first, max: last });
    for (const moment of moments) {
      const tick = made("button", "", moment.bad ? "tick bad" : "tick");
      tick.style.left = `${100 * Math.min(1, Math.max(0, (moment.time - first) / Math.max(last - first, 1e-9)))}%`;
      tick.title = moment.text;
      tick.setAttribute("aria-label", moment.text);
      tick.addEventListener("click", () => { state.time = moment.time; remember(); arrange(); });
      element("bar").append(tick);
    }
    element("moment").addEventListener("input", () => { state.time = Number(element("moment").value); remember(); arrange(); });
  }

  // ---- beside the picture ------------------------------------------------------------------------------------------------
  const refreshers = [], refresh = () => { for (const one of refreshers) one(); };
  function open(view) {
    const kept = state.off.filter((path) => !shown.views.some((one) => one.hidden.includes(path)));
    state.off = [...kept, ...view.hidden];
    remember(); refresh(); arrange();
  }
  for (const [k, view] of shown.views.entries()) {
    const button = made("button", view.name);
    button.title = `View ${k + 1} (key ${k + 1})`;
    button.addEventListener("click", () => open(view));
    if (shown.views.length > 1) element("views").append(button, " ");
  }
  if (trusted.length) {
    const button = made("button", "what to trust"), list = element("trusted");
    button.id = "trust";
    button.title = "Green: can be trusted; red: cannot; grey: nothing is known (t)";
    const turn = () => { state.trust = !state.trust; remember(); refresh(); showTrust(); };
    button.addEventListener("click", turn);
    KEYS.t = turn;
    element("views").append(button);
    refreshers.push(() => { button.setAttribute("aria-pressed", String(state.trust)); element("doubts").open = state.trust; });
    element("doubts").hidden = false;
    for (const [name, { share, reasons, color }] of trusted.sort((a, b) => a[1].share - b[1].share || (a[0] < b[0] ? -1 : 1))) {
      const row = made("div", undefined, "node"), dot = made("i"), says = made("button", name);
      dot.style.background = `rgb(${color})`;
      says.addEventListener("click", () => choose(name, true));
      for (const event of ["mouseenter", "focus"]) says.addEventListener(event, () => markNode(name));
      row.append(dot, says, made("small", reasons.join("; ") || "nothing speaks against it"));
      row.title = `${Math.round(100 * share)} %`;
      list.append(row);
    }
  }
  for (const group of [...new Set(things.map(({ path }) => groupOf(path)))]) {
    const row = made("div", undefined, "row"), label = made("label"), box = made("input"), fade = made("input");
    Object.assign(box, { type: "checkbox" });
    Object.assign(fade, { type: "range", min: 0, max: 1, step: 0.05, title: "fade" });
    fade.setAttribute("aria-label", `fade ${group}`);
    row.dataset.layer = group;
    label.append(box, " " + group.replaceAll("_", " "));
    box.addEventListener("change", () => {
      state.off = state.off.filter((path) => groupOf(path) !== group);
      if (!box.checked) state.off.push(group);
      remember(); arrange();
    });
    fade.addEventListener("input", () => { state.fade[group] = Number(fade.value); remember(); arrange(); });
    refreshers.push(() => { box.checked = !state.off.includes(group); fade.value = state.fade[group] ?? 1; });
    row.append(label, fade);
    element("layers").append(row);
  }
  for (const link of shown.joints.filter((one) => one.kind !== "fixed" && one.upper > one.lower)) {
    const row = made("div", undefined, "row"), label = made("label", link.name), slide = made("input"), says = made("output");
    Object.assign(slide, { type: "range", min: link.lower, max: link.upper, step: "any", title: link.name });
    slide.setAttribute("aria-label", link.name);
    const tells = () => { const value = state.joints[link.name] ?? link.value; slide.value = value; says.textContent = link.kind === "turning" ? `${(value * 180 / Math.PI).toFixed(0)}°` : `${(100 * value).toFixed(1)} cm`; };
    slide.addEventListener("input", () => { state.joints[link.name] = Number(slide.value); tells(); remember(); arrange(); });
    refreshers.push(tells);
    row.dataset.joint = link.name;
    row.append(label, slide, says);
    element("joints").append(row);
    element("joined").hidden = false;
  }
  if (shown.graph) {
    element("tree").hidden = false;
    const below = new Map(), above = new Set(shown.graph.edges.map(([, child]) => child));
    for (const [parent, child] of shown.graph.edges) below.set(parent, [...(below.get(parent) || []), child]);
    const colors = new Map(shown.graph.names.map((name, k) => [name, shown.graph.colors[k]]));
    const rows = new Set();
    const put = (name, parent, depth) => {
      if (rows.has(name)) return;
      rows.add(name);
      const row = made("div", undefined, "node"), button = made("button", name, "name"), dot = made("i");
      row.style.paddingLeft = `${12 * depth}px`;
      dot.style.background = `rgb(${colors.get(name)})`;
      button.title = name;
      for (const event of ["mouseenter", "focus"]) button.addEventListener(event, () => markNode(name));
      button.addEventListener("click", () => choose(name, true));
      row.append(dot, button);
      const found = parent && labelled.filter(({ text }) => text.startsWith(parent + " ") && text.split(":")[0].endsWith(" " + name));
      if (found && found.length) {
        const edge = made("button", found[0].text.split(":")[0].slice(parent.length + 1, -name.length - 1), "edge");
        edge.title = found[0].text;
        edge.addEventListener("click", () => { mark([...found[0].points]); tell(found); });
        row.append(edge);
      }
      element("nodes").append(row);
      for (const child of below.get(name) || []) put(child, name, Math.min(depth + 1, 12));
    };
    for (const name of shown.graph.names) if (!above.has(name)) put(name, "", 0);
    for (const name of shown.graph.names) put(name, "", 0);
  }
  const images = new Map();
  for (const [path, list] of byPath(shown.pictures)) {
    const image = made("img");
    image.alt = path;
    images.set(image, list);
    element("pictures").append(made("p", path), image);
  }
  for (const [path, list] of byPath(shown.documents)) {
    const details = made("details"), body = made("div", undefined, "document");
    details.append(made("summary", path), body);
    const words = (place, text) => { text.split("**").forEach((part, k) => place.append(k % 2 ? made("b", part) : part)); };
    let table = null, literal = null;
    for (const line of list[list.length - 1].text.split("\n")) {
      if (line.startsWith("```")) { literal = literal ? null : made("pre", ""); if (literal) body.append(literal); continue; }
      if (literal) { literal.append(line + "\n"); continue; }
      if (line.startsWith("|")) {
        if (/^[|\-: ]+$/.test(line)) continue;
        if (!table) { table = made("table"); body.append(table); }
        const row = made("tr");
        for (const cell of line.replace(/^\| ?|\|$/g, "").split("|")) { const place = made("td"); words(place, cell.trim()); row.append(place); }
        table.append(row);
        continue;
      }
      table = null;
      const heading = line.match(/^(#+) (.*)/), place = made(heading ? "h3" : "div");
      words(place, heading ? heading[2] : line);
      body.append(place);
    }
    element("documents").append(details);
  }

  // Nothing in three dimensions: a page to read.
  if (!things.length) {
    document.body.classList.add("reading");
    for (const details of element("documents").children) details.open = true;
  }
  if (!readAddress() && shown.views.length) state.off = [...shown.views[0].hidden];
  refresh();
  showTrust();
  arrange();
  if (state.chosen) choose(state.chosen, false);
  if (!renderer) say("This browser shows no WebGL: a coarse picture without lines; everything else works.");
  document.body.dataset.ready = "yes";
  window.scenewright = {
    shown, state, boxes, scene, made, element, say, mark, markNodes, choose, draw, remember, addressOf, KEYS, EDGES,
    on: (what, listener) => listeners.get(what).push(listener),
  };
  window.dispatchEvent(new Event("scenewright-ready"));
})();
