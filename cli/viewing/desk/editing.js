"use strict";
// Putting an artifact right: forms out of the kinds of edits that the server knows, filled by clicking; every edit is
// written by the server, which says what it came to. Nothing is kept here that a line of edits.toml does not say.
window.addEventListener("scenewright-ready", async function () {
  const { shown, state, boxes, scene, made, element, say, mark, markNodes, choose, draw, addressOf, KEYS, on } = window.scenewright;
  const served = shown.served, desk = element("desk");
  let known = served.forms ? { revision: served.revision } : null;  // what the server said last
  let form = null;       // the form that is being filled
  let values = {};       // its fields
  let wanted = null;     // the field that the next click is for
  let corners = [];      // of a box that is being drawn
  let busy = false;

  const trouble = made("p", "", "trouble");
  trouble.setAttribute("role", "alert");
  const complain = (text) => { trouble.textContent = text; };
  async function ask(path, body) {
    const options = body === undefined ? {} : { method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify(body) };
    let answer;
    try { answer = await fetch(path, { ...options, cache: "no-store" }); } catch { throw new Error("the server does not answer: it was stopped, or the machine is busy"); }
    const told = await answer.json().catch(() => ({ error: `the server answered ${answer.status}` }));
    if (!answer.ok) throw new Error(told.error || `the server answered ${answer.status}`);
    return told;
  }

  // ---- the panel -----------------------------------------------------------------------------------------------------
  const card = made("div", undefined, "card"), kinds = made("div", undefined, "kinds"), place = made("form"), list = made("ol");
  place.hidden = place.noValidate = true;  // the server says what is wrong
  card.append(made("b", served.forms ? (served.read_only ? "What was put right" : "Put right") : ""), trouble);
  const names = made("datalist");
  names.id = "classes";
  if (served.forms) {
    for (const name of served.classes) { const option = made("option"); option.value = name; names.append(option); }
    const several_ = new Set(served.forms.map((one) => one.of)).size > 1;
    let of = "";
    for (const one of served.read_only ? [] : served.forms) {
      if (several_ && one.of !== of) kinds.append(made("small", `${of = one.of}`.replaceAll("_", " "), "of"));
      const button = made("button", one.what);
      button.type = "button";
      button.dataset.kind = one.what;
      button.title = one.says;
      button.addEventListener("click", () => begin(form === one ? null : one));
      kinds.append(button);
    }
    const next = made("details");
    next.append(made("summary", served.next.length > 1 ? "The next commands" : "The next command"), ...served.next.map((line) => made("code", line)));
    const models = made("datalist");
    models.id = "models";
    for (const name of served.models) { const option = made("option"); option.value = name; models.append(option); }
    card.append(kinds, place, list, names, models);
    desk.append(card, next);
    for (const name of ["by", "note"]) values[name] = "";
  } else desk.append(trouble);

  function begin(one) {
    form = one; values = {}; corners = []; wanted = null;
    for (const button of kinds.children) button.setAttribute("aria-pressed", String(one !== null && button.dataset.kind === one.what));
    drawBox(null);
    complain("");
    if (!one) { place.hidden = true; place.replaceChildren(); aim(); return; }
    for (const field of one.fields) {
      values[field.name] = field.kind === "things" ? [] : field.start;
      if (state.chosen && (field.kind === "things" || field.kind === "thing" && !values.of)) take(field, state.chosen);
    }
    wanted = one.fields.find((field) => CLICKED.includes(field.kind) && (field.kind === "things" || field.needed && empty(field))) || null;
    fill();
  }
  const CLICKED = ["thing", "things", "box", "point", "points", "place", "direction"];
  const known_ = () => served.things?.[values.of];  // what the server says of the thing that the edit is about
  const empty = (field) => values[field.name] === null || values[field.name] === undefined || values[field.name] === "" || (["things", "points"].includes(field.kind) && (values[field.name]?.length ?? 0) < field.fewest);
  const complete = () => form.fields.every((field) => !field.needed || !empty(field));

  function fill() {
    place.replaceChildren(made("p", form.says, "says"));
    if (known_()?.says) place.append(made("p", `${values.of}: ${known_().says}`, "says"));
    place.hidden = false;
    for (const field of form.fields) {
      // A label would pass clicks on its text to the first button in it.
      const label = made([...CLICKED, "numbers", "model"].includes(field.kind) ? "div" : "label", undefined, "field");
      label.title = field.says;
      label.append(made("span", field.name.replaceAll("_", " ") + (field.needed ? "" : " (may be left out)")), widget(field));
      place.append(label);
    }
    const note = made("input"), send = made("button", "write it down", "first"), stop = made("button", "never mind");
    Object.assign(note, { placeholder: "why (may be left out)", maxLength: 10000, value: values.note || "" });
    note.dataset.field = "note";
    note.addEventListener("input", () => { values.note = note.value; });
    send.type = "submit"; stop.type = "button";
    send.disabled = !complete();
    stop.addEventListener("click", () => begin(null));
    const row = made("div", undefined, "tools");
    row.append(send, stop);
    place.append(note, row);
    preview();
    aim();
  }
  const ready = () => { const send = place.querySelector("[type=submit]"); if (send) send.disabled = !complete() || busy; };
  const set = (field, value) => { values[field.name] = value; preview(); ready(); };

  const WIDGETS = {
    thing: slot, things: slot,
    class(field) { const input = line(field, "a class"); input.setAttribute("list", "classes"); return input; },
    text: (field) => line(field, ""),
    number(field) {
      const input = line(field, "");
      Object.assign(input, { type: "number", step: "any" });
      if (field.least !== undefined) input.min = field.least;
      if (field.most !== undefined) input.max = field.most;
      input.addEventListener("input", () => set(field, input.value === "" ? null : Number(input.value)));
      return input;
    },
    yes(field) {
      const input = made("input");
      Object.assign(input, { type: "checkbox", checked: values[field.name] === true });
      input.addEventListener("change", () => set(field, input.checked));
      return input;
    },
    choice(field) {
      const input = made("select");
      if (!field.needed || values[field.name] === null) input.append(made("option", ""));
      for (const choice of field.choices) { const option = made("option", String(choice)); option.selected = values[field.name] === choice; input.append(option); }
      input.addEventListener("change", () => set(field, field.choices.find((choice) => String(choice) === input.value) ?? null));
      return input;
    },
    point: (field) => clicked(field, "click where"),
    points(field) {
      const whole = clicked(field, `click ${values[field.name]?.length ? "another one" : "places on it"}`, false), given = values[field.name] || [];
      if (given.length) {
        const again = made("button", `${given.length} places ×`, "thing");
        again.type = "button";
        again.title = "begin again";
        again.addEventListener("click", () => { values[field.name] = []; wanted = field; fill(); });
        whole.append(again);
      }
      return whole;
    },
    place: (field) => clicked(field, "click what it is to stand on"),
    direction(field) {
      const row = made("div", undefined, "kinds"), whole = clicked(field, { normal: "click a surface: out of it", along: corners.length ? "and to where" : "click from where" }[way] || "");
      for (const [word, given] of [["up", [0, 0, 1]], ["down", [0, 0, -1]], ["out of a surface", "normal"], ["along two clicks", "along"]]) {
        const one = made("button", word);
        one.type = "button";
        one.addEventListener("click", () => { corners = []; if (typeof given === "string") { way = given; wanted = field; } else { way = ""; values[field.name] = given; following(); } fill(); });
        row.append(one);
      }
      whole.prepend(row);
      return whole;
    },
    joint(field) {
      const input = made("select"), joints = known_()?.joints || [];
      if (!joints.some((joint) => joint.name === values[field.name])) values[field.name] = joints.length === 1 ? joints[0].name : null;
      input.append(made("option", joints.length ? "" : values.of ? "it has none" : "click a thing first"));
      for (const joint of joints) { const option = made("option", `${joint.name} (${joint.says})`); option.value = joint.name; option.selected = values[field.name] === joint.name; input.append(option); }
      input.addEventListener("change", () => set(field, joints.some((joint) => joint.name === input.value) ? input.value : null));
      return input;
    },
    model(field) {
      const whole = made("div"), row = made("div", undefined, "kinds"), input = line(field, "a model");
      input.setAttribute("list", "models");
      for (const word of [...field.choices, ...(known_()?.models || [])]) {
        const one = made("button", word);
        one.type = "button";
        one.addEventListener("click", () => { input.value = word; set(field, word); });
        row.append(one);
      }
      whole.append(input, row);
      return whole;
    },
    numbers: (field) => several(field, field.count, "", values[field.name], (numbers) => set(field, numbers)),
    box,
  };
  function widget(field) {
    const made_ = WIDGETS[field.kind](field);
    made_.dataset.field = field.name;
    return made_;
  }
  function line(field, hint) {
    const input = made("input");
    Object.assign(input, { placeholder: hint, value: values[field.name] ?? "", maxLength: 10000 });
    input.addEventListener("input", () => set(field, input.value));
    return input;
  }
  function several(field, count, hint, given, tell) {
    const whole = made("div", undefined, "numbers"), inputs = [];
    for (let k = 0; k < count; k++) {
      const input = made("input");
      Object.assign(input, { type: "number", step: "0.005", placeholder: hint, value: given ? given[k] : "" });
      input.setAttribute("aria-label", `${field.name} ${"xyz"[k] || k + 1}`);
      input.addEventListener("input", () => { const numbers = inputs.map((one) => parseFloat(one.value)); if (numbers.every(Number.isFinite)) tell(numbers); });
      inputs.push(input);
      whole.append(input);
    }
    return whole;
  }
  let way = "";          // how the next clicks say a direction
  function clicked(field, hint, numbers = true) {
    const whole = made("div"), where = made("div", undefined, "slot");
    if (wanted === field) where.classList.add("wanted");
    where.append(made("span", wanted === field ? hint : "click to point at it", "hint"));
    where.addEventListener("click", () => { wanted = field; corners = []; fill(); });
    whole.append(...(hint ? [where] : []), ...(numbers ? [several(field, 3, "", values[field.name], (numbers) => set(field, numbers))] : []));
    return whole;
  }
  function slot(field) {
    const whole = made("div", undefined, "slot"), given = field.kind === "things" ? values[field.name] : values[field.name] ? [values[field.name]] : [];
    if (wanted === field) whole.classList.add("wanted");
    for (const name of given) {
      const one = made("button", name + " ×", "thing");
      one.type = "button";
      one.title = "take it out";
      one.addEventListener("click", (event) => {
        event.preventDefault();
        values[field.name] = field.kind === "things" ? values[field.name].filter((other) => other !== name) : null;
        wanted = field;
        fill();
      });
      whole.append(one);
    }
    if (!given.length || field.kind === "things") whole.append(made("span", given.length ? "click another one" : "click a thing in the picture", "hint"));
    for (const word of field.choices || []) {
      const one = made("button", String(word));
      one.type = "button";
      one.addEventListener("click", (event) => { event.preventDefault(); values[field.name] = word; wanted = null; fill(); });
      whole.append(one);
    }
    whole.addEventListener("click", () => { if (wanted !== field) { wanted = field; fill(); } });
    return whole;
  }
  function box(field) {
    const whole = made("div"), given = values[field.name], where = made("div", undefined, "slot");
    if (wanted === field) where.classList.add("wanted");
    where.append(made("span", wanted === field ? (corners.length ? "click the opposite corner" : "click one corner in the picture") : given ? "draw it again" : "draw it", "hint"));
    where.addEventListener("click", (event) => { event.preventDefault(); wanted = field; corners = []; fill(); });
    whole.append(where);
    if (given) {
      const change = (part) => (numbers) => { set(field, { ...values[field.name], [part]: part === "yaw_degrees" ? numbers[0] : numbers }); drawBox(values[field.name]); };
      for (const [part, count, text] of [["center", 3, "middle x, y, z [m]"], ["size", 3, "edges; the last one up [m]"], ["yaw_degrees", 1, "turn [degrees]"]]) {
        const numbers = part === "yaw_degrees" ? [given[part] ?? 0] : given[part];
        whole.append(made("small", text), several({ name: `${field.name} ${part}` }, count, "", numbers, change(part)));
      }
    }
    return whole;
  }

  // ---- the box as it is drawn ----------------------------------------------------------------------------------------
  const drawn = new THREE.Group(), inside = new THREE.Mesh(new THREE.BoxGeometry(1, 1, 1), new THREE.MeshBasicMaterial({ color: 0xff8a00, transparent: true, opacity: 0.22, depthWrite: false }));
  drawn.add(inside, new THREE.LineSegments(new THREE.EdgesGeometry(inside.geometry), new THREE.LineBasicMaterial({ color: 0xd96a00 })));
  drawn.visible = false;
  scene.add(drawn);
  function drawBox(given) {
    drawn.visible = !!given;
    if (given) {
      drawn.position.set(...given.center);
      drawn.scale.set(...given.size.map((edge) => Math.max(edge, 0.002)));
      drawn.rotation.set(0, 0, (given.yaw_degrees || 0) * Math.PI / 180);
    }
    draw();
  }
  const drawMarks = (points) => drawBox(points.length ? { center: points[points.length - 1], size: [0.03, 0.03, 0.03] } : null);
  function preview() {
    const box = form?.fields.find((field) => field.kind === "box"), goes = form?.fields.find((field) => field.kind === "place"), at = known_()?.box;
    if (goes && at) drawBox({ ...at, center: values[goes.name] || at.center, yaw_degrees: at.yaw_degrees + (values.turn_degrees || 0) });
    else if (box) drawBox(values[box.name]);
  }
  const round = (value) => Math.round(1000 * value) / 1000;
  function boxOf(a, b) {
    // Two clicks on surfaces: what lies between them, and a little more, so that flat things have a height.
    const low = a.map((value, k) => Math.min(value, b[k]) - 0.01), high = a.map((value, k) => Math.max(value, b[k]) + 0.01);
    if (high[2] - low[2] < 0.05) high[2] = low[2] + 0.05;
    return { center: low.map((value, k) => round((value + high[k]) / 2)), size: low.map((value, k) => round(high[k] - value)), yaw_degrees: 0 };
  }

  // ---- clicks --------------------------------------------------------------------------------------------------------
  const POINTED = ["box", "point", "points", "place", "direction"];
  function aim() {
    const picking = form && wanted && POINTED.includes(wanted.kind);
    element("picture").classList.toggle("aiming", Boolean(picking));
    const chosen = form ? form.fields.flatMap((field) => (field.kind === "things" ? values[field.name] : field.kind === "thing" && values[field.name] ? [values[field.name]] : [])) : [];
    if (form) markNodes(chosen.length ? chosen : state.chosen ? [state.chosen] : []);
  }
  function take(field, name) {
    if (field.kind === "thing") values[field.name] = name;
    else values[field.name] = values[field.name].includes(name) ? values[field.name].filter((one) => one !== name) : [...values[field.name], name];
  }
  on("point", (point, normal) => {
    if (!form || !wanted || !POINTED.includes(wanted.kind) || wanted.kind === "direction" && !way) return false;
    if (wanted.kind === "point") { values[wanted.name] = point.map(round); following(); return true; }
    if (wanted.kind === "points") { values[wanted.name] = [...(values[wanted.name] || []), point.map(round)]; drawMarks(values[wanted.name]); fill(); return true; }
    if (wanted.kind === "place") { values[wanted.name] = [point[0], point[1], point[2] + (known_()?.box.size[2] || 0) / 2].map(round); wanted = null; fill(); return true; }
    if (way === "normal") { values[wanted.name] = normal.map(round); way = ""; following(); return true; }
    corners.push(point);
    if (corners.length === 2 && way === "along") {
      const across = corners[1].map((value, k) => value - corners[0][k]), length = Math.hypot(...across);
      if (length > 1e-3) values[wanted.name] = across.map((value) => round(value / length));
      way = ""; corners = [];
      following();
    } else if (corners.length === 2) {
      values[wanted.name] = boxOf(...corners);
      drawBox(values[wanted.name]);
      corners = [];
      following();
    } else fill();
    return true;
  });
  function following() { wanted = form.fields.find((field) => CLICKED.includes(field.kind) && field.needed && empty(field)) || null; fill(); }
  on("chosen", (name) => {
    if (!form || !name) return;
    const field = wanted && ["thing", "things"].includes(wanted.kind) ? wanted : form.fields.find((one) => one.kind === "things") || form.fields.find((one) => one.kind === "thing" && empty(one)) || form.fields.find((one) => one.kind === "thing");
    if (!field) return;
    take(field, name);
    const goes = form.fields.find((one) => one.kind === "place");
    if (goes && field.name === "of") values[goes.name] = known_()?.box.center ?? null;
    if (field.kind === "thing") following(); else fill();
  });

  // ---- writing -------------------------------------------------------------------------------------------------------
  place.addEventListener("submit", async (event) => {
    event.preventDefault();
    if (!complete() || busy) return;
    const edit = { what: form.what };
    for (const field of form.fields) if (!empty(field)) edit[field.name] = values[field.name];
    if (await send({ edit, note: values.note || "" })) begin(null);
  });
  async function send(more) {
    busy = true; ready(); complain("");
    try {
      const told = await ask("do", { artifact: served.artifact, revision: known.revision, by: "", ...more });
      show(told);
      if (outdated()) again();
      return true;
    } catch (error) {
      complain(error.message);
      look();
      return false;
    } finally { busy = false; ready(); }
  }
  // By what this page was made with, not by what was told last: of an answer and a look that cross, either may be the last.
  const outdated = () => served.shows_edits && known.revision !== served.revision && !known.trouble;
  function again() {
    // The server draws the map as the edits leave it; the address keeps the view.
    state.chosen = "";
    try { history.replaceState(null, "", addressOf()); } catch { /* the view starts anew */ }
    location.reload();
  }
  function show(told) {
    const before = known;
    known = told;
    if (told.trouble) complain(told.trouble);
    else if (before && before.trouble) complain("");
    document.body.dataset.revision = told.revision ?? "";
    if (!told.rows || before && JSON.stringify(before.rows) === JSON.stringify(told.rows)) return;
    list.replaceChildren();
    for (const row of [...told.rows].reverse()) {
      const line = made("li"), words = made("div", undefined, "told");
      words.append(made("b", row.what), " ", row.of, " ", made("span", row.status, row.status));
      if (row.reason) words.append(made("small", row.reason));
      words.append(made("small", [row.by, row.when.replace("T", " ").replace("Z", ""), row.note].filter(Boolean).join(" · ")));
      line.dataset.number = row.number;
      line.append(words);
      if (!served.read_only) {
        const undo = made("button", "undo");
        undo.title = "delete this line of the file";
        undo.addEventListener("click", () => { if (!busy) send({ remove: row.number }); });
        line.append(undo);
      }
      if (row.things.length) line.addEventListener("mouseenter", () => { if (!form) markNodes(row.things); });
      list.append(line);
    }
    if (!told.rows.length) list.append(made("li", served.read_only ? "Nothing so far." : "Nothing so far. Choose what is wrong, or click a thing first."));
  }
  let asking = false;
  async function look() {
    if (asking || document.hidden) return;
    asking = true;
    try {
      const told = await ask("now");
      show(told);
      if (outdated() && !form && !busy) again();
    } catch (error) { complain(error.message); }
    asking = false;
  }
  KEYS.Enter = () => { if (form && complete()) place.requestSubmit(); };
  const escape = KEYS.Escape;
  KEYS.Escape = () => { if (form) begin(null); escape(); };
  const taken = new Set([...Object.keys(KEYS)]);
  for (const one of served.read_only ? [] : served.forms || []) {
    const key = [...one.what].find((letter) => !taken.has(letter));
    if (!key) continue;
    taken.add(key);
    KEYS[key] = () => begin(form === one ? null : one);
    const button = [...kinds.children].find((other) => other.dataset.kind === one.what);
    button.title += ` (key ${key})`;
  }
  await look();
  setInterval(look, 2000);
  document.body.dataset.desk = "yes";
});
