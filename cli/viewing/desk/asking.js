"use strict";
// Words asked of a language map: the server answers with boxes, the likeliest first, and with how warm Gaussians are.
window.addEventListener("scenewright-ready", function () {
  const { shown, scene, state, made, element, draw, remember, KEYS, EDGES } = window.scenewright;
  if (!shown.served?.asks) return;
  const form = made("form", undefined, "card"), input = made("input"), said = made("p"), list = made("ol");
  Object.assign(input, { type: "search", id: "words", placeholder: "red mug", maxLength: 300 });
  input.setAttribute("aria-label", "What is looked for");
  said.id = "answered";
  said.setAttribute("role", "status");
  const ask = made("button", "where is it?");
  form.append(input, " ", ask, said, list);
  element("desk").append(form);
  KEYS["/"] = () => input.focus();

  const warm = new THREE.Points(new THREE.BufferGeometry(), new THREE.PointsMaterial({ size: 0.03, vertexColors: true }));
  const frames = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ vertexColors: true, depthTest: false }));
  for (const one of [warm, frames]) { one.frustumCulled = false; one.renderOrder = 8; scene.add(one); }
  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const fill = (object, places, colors) => {
    object.geometry.dispose();
    object.geometry = new THREE.BufferGeometry();
    object.geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
    object.geometry.setAttribute("color", new THREE.BufferAttribute(colors, 3, true));
  };
  // from dark blue over orange to bright yellow
  const glow = (share) => [Math.min(255, 40 + 430 * share), Math.max(0, 460 * share - 200), Math.max(0, 140 - 280 * share)];
  const likely = (share) => [220 * (1 - share), 40 + 130 * share, 40];

  function show(told) {
    const warmth = bytes(told.warmth);
    fill(warm, new Float32Array(bytes(told.places).buffer), Uint8Array.from(Array.from(warmth).flatMap((value) => glow(value / 255))));
    const points = [], colors = [];
    list.replaceChildren();
    for (const place of told.answers) {
      const color = likely(place.probability);
      for (const pair of EDGES) for (const k of pair) { points.push(...place.corners.slice(3 * k, 3 * k + 3)); colors.push(...color); }
      const row = made("li"), button = made("button", `${place.probability.toFixed(2)} ${place.name} at ${place.center.map((v) => v.toFixed(2)).join(", ")} m${place.doubtful ? ", by one doubtful name" : ""}`);
      button.type = "button";
      button.addEventListener("click", () => { state.target = [...place.center]; state.eye[2] = Math.min(state.eye[2], 2.5); remember(); draw(); });
      row.append(button);
      list.append(row);
    }
    fill(frames, new Float32Array(points), new Uint8Array(colors));
    const words = [told.answers.length ? `${told.answers.length} of “${told.text}”` : told.unknown ? `Whether the room has “${told.text}” is unknown.` : `The room has no “${told.text}”.`];
    if (!told.answers.length && told.next_best) words.push(`Nearest: ${told.next_best.probability.toFixed(2)} at ${told.next_best.center.map((v) => v.toFixed(2)).join(", ")} m.`);
    if (told.understood) words.push(`${told.understood}.`);
    else if (told.unread.length) words.push(`Never read: ${told.unread.join(", ")}.`);
    if (told.strange) words.push("The encoder has learned no pictures like these: hardly anything is believed.");
    if (!told.calibrated) words.push("Not calibrated: numbers are relevancies.");
    words.push(`${told.milliseconds} ms`);
    said.textContent = words.join(" ");
    document.body.dataset.warm = String(warmth.length);
    draw();
  }
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    ask.disabled = true;
    said.textContent = "…";
    try {
      const answer = await fetch("ask", { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ text: input.value }), cache: "no-store" });
      const told = await answer.json();
      if (answer.ok) show(told); else said.textContent = told.error;
    } catch { said.textContent = "the server does not answer: it was stopped, or the machine is busy"; }
    ask.disabled = false;
  });
});
