// The technician's page: asks the appliance once a second how it is, and shows it in plain words.
// Everything that comes from the appliance is put in as text, never as markup.
"use strict";

const POLL_MS = 1000;
const RESTART_MS = 180000;          // a restart takes no longer, one into the old version included
const ANSWER_MS = 8000;             // the appliance itself waits 3 s for its daemon
const STOPPED = 502;                // the updater closed its end before the bundle's
const BUNDLE_MAX = 64 * 1024 * 1024; // as the appliance's: what is larger is no bundle

const $ = (id) => document.getElementById(id);

// ---- drawing ----

function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  const { kind, ...rest } = properties;
  Object.assign(made, rest);
  if (kind) made.dataset.kind = kind;
  made.append(...children.filter((child) => child !== null && child !== ""));
  return made;
}

// Only what has changed is replaced: a screen reader isn't told the same again, and nothing flickers.
function fill(target, ...children) {
  const made = element(target.tagName, {}, ...children);
  if (made.innerHTML !== target.innerHTML) target.replaceChildren(...made.childNodes);
}

function write(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

function mark(target, kind) {
  if (target.dataset.kind !== kind) target.dataset.kind = kind;
}

function say(target, kind, ...lines) {
  mark(target, kind);
  fill(target, ...lines.map((line) => element("div", {}, line)));
}

function duration(seconds) {
  if (seconds === null || seconds === undefined) return "";
  if (seconds < 90) return `${Math.round(seconds)} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return `${Math.round(seconds / 3600)} h`;
}

function when(iso) {
  return iso ? `${iso.replace("T", " ").replace(/:\d\d(\.\d+)?(Z|\+00:00)$/, "")} UTC` : "time unknown";
}

// ---- asking ----

class Refused extends Error {
  constructor(code, sentence) {
    super(sentence);
    this.code = code;
  }
}

// An object, or throws: Refused with the appliance's sentence, another error when nothing answered.
async function ask(method, path, body) {
  const options = { method, credentials: "same-origin", headers: { "X-Odid-Page": "1" },
                    signal: AbortSignal.timeout(method === "GET" ? ANSWER_MS : 4 * ANSWER_MS) };
  if (body !== undefined) options.body = JSON.stringify(body);
  const answer = await fetch(path, options);
  const read = await answer.json();
  if (!answer.ok) throw new Refused(answer.status, read.sentence);
  return read;
}

const NOT_REACHED = "The aircraft can't be reached. Is this device still on its Wi-Fi, or on its cable?";

function sentenceOf(error) {
  return error instanceof Refused ? error.message : NOT_REACHED;
}

// ---- state: the one thing to be seen ----

let status = null;      // what was told last
let heardAt = 0;        // and when
let restarting = false; // the updater said that it will restart

function showState(kind, title, text) {
  mark($("state"), kind);
  write($("state-title"), title);
  write($("state-text"), text);
  document.title = `${title} – Remote ID`;
}

function showSilence() {
  document.body.classList.add("stale");
  $("problems").hidden = true;
  if (restarting && Date.now() - heardAt < RESTART_MS) {
    showState("unknown", "Restarting", "The aircraft restarts with the new software. That takes about a minute; this " +
      "page goes on by itself, unless the Wi-Fi has to be joined again.");
  } else {
    const ago = heardAt ? ` Last heard ${duration((Date.now() - heardAt) / 1000)} ago.` : "";
    showState("unknown", "Not connected", `This page doesn't reach the aircraft; that says nothing about whether it ` +
      `transmits.${ago} It closes when the aircraft is armed. Else: is this device still on its Wi-Fi, or on its cable?`);
  }
}

function showVerdict(daemon, silence) {
  if (!daemon) {
    showState("bad", "Not on the air", {
      "not running": "The Remote ID program isn't running. It is restarted by itself within seconds; if it stays so, " +
        "switch the power off and on.",
      "does not answer": "The Remote ID program doesn't answer. It is restarted by itself within seconds; if it stays so, " +
        "switch the power off and on.",
    }[silence] || "The Remote ID program can't be asked how it is. Switch the power off and on.");
    return;
  }
  const some = Object.values(daemon.channels).some((channel) => channel.state === "on air");
  const faults = daemon.problems.some((problem) => problem.severity === "fault");
  if (!daemon.on_air) {
    showState("bad", some ? "Only partly on the air" : "Not on the air", "Don't fly. See below what to do.");
  } else if (faults) {
    showState("warn", "On the air, not ready", "It transmits, but don't fly yet: what it says isn't complete or right. " +
      "See below what to do.");
  } else {
    showState("good", "On the air", daemon.problems.length
      ? "It transmits, and nothing stands against flying. Something is worth mending: see below."
      : "It transmits, and nothing stands against flying.");
  }
}

// ---- what is wrong, and what to do ----

// The daemon's advice speaks of odid.conf; where this page can do it, the page says so.
const HERE = {
  __proto__: null, // else every object's own names would be found
  "operator-id-missing": ["No operator number", "Nobody can tell who flies it. Enter the number below."],
  "operator-id-invalid": [null, "Compare the operator number below with the registration."],
  "basic-id-missing": ["No serial number", "Nobody can tell which aircraft it is. Enter the number below."],
  "basic-id-invalid": [null, "Compare the serial number below with the aircraft's label."],
};

function problemText(problem) {
  const [heading, advice] = HERE[problem.id] || [];
  return [element("strong", {}, heading || sentence(problem.reason)), element("span", {}, advice || problem.advice)];
}

function sentence(text) {
  return text ? text[0].toUpperCase() + text.slice(1) : "";
}

function showProblems(answer) {
  const items = [];
  for (const problem of answer.daemon ? answer.daemon.problems : []) {
    items.push(element("li", { kind: problem.severity === "fault" ? "bad" : "warn" }, ...problemText(problem)));
  }
  for (const fault of answer.faults) {
    items.push(element("li", { kind: "warn" }, element("strong", {}, "The computer on board"), element("span", {}, fault.sentence)));
  }
  for (const line of answer.daemon ? answer.daemon.configuration.sentences : []) {
    items.push(element("li", { kind: "warn" }, element("strong", {}, "A setting"), element("span", {}, sentence(line))));
  }
  $("problems").hidden = items.length === 0;
  fill($("problem-list"), ...items);
}

// ---- transmitters ----

const STATES = { // word and kind, when the channel is required and when not
  __proto__: null,
  "on air": ["On the air", "good"],
  "disabled": ["Switched off", ""],
  "unsupported": ["Not possible", ""],
  "absent": ["Not found", "bad"],
  "blocked": ["Radio switched off", "bad"],
  "down": ["Down", "bad"],
  "starting": ["Starting", "warn"],
  "lost": ["Lost", "bad"],
};

function showChannels(daemon) {
  fill($("channel-list"), ...Object.values(daemon.channels).map((channel) => {
    const [word, kind] = STATES[channel.state] || [channel.state, "bad"];
    return element("li", {}, element("span", { className: "name" }, channel.title),
      element("span", { className: "badge", kind: channel.required || kind === "good" ? kind : "" }, word),
      channel.detail ? element("span", { className: "detail" }, channel.detail) : "");
  }));
}

// ---- what the aircraft says ----

function place(here) {
  return here.latitude_deg === null || here.longitude_deg === null ? null
    : `${here.latitude_deg.toFixed(6)}, ${here.longitude_deg.toFixed(6)}`;
}

function validity(text, right) {
  if (!text) return null;
  if (text === "valid" || text === "structure right") return { text: right };
  return text === "not checked" ? null : { text: sentence(text), kind: "bad" };
}

function row(name, value, aside) {
  return [element("dt", {}, name),
          element("dd", {}, element("span", { className: "value" }, value || "unknown"),
                  aside && aside.text ? element("span", { className: "aside", kind: aside.kind }, aside.text) : "")];
}

function positionAside(position) {
  if (place(position) === null) return { text: "It says so on the air.", kind: "warn" };
  if (!position.fresh) return { text: `${duration(position.age_s)} old`, kind: "bad" };
  return { text: position.age_s < 1 ? "less than a second old" : `${duration(position.age_s)} old` };
}

const SAID_BY = { native: "from the autopilot", telemetry: "from the autopilot", configuration: "from the settings" };

function showAircraft(daemon) {
  const { identity, position, operator, aircraft } = daemon;
  const rows = [];
  for (const id of identity.basic_ids) {
    const aside = validity(id.validity, "The format is right.") || {};
    rows.push(...row(id.id_type === "serial" ? "Serial number" : sentence(id.id_type), id.uas_id,
      aside.kind || id.source !== "native" ? aside : { text: `${aside.text || ""} It comes from the autopilot.`.trim() }));
  }
  if (!identity.basic_ids.length) rows.push(...row("Serial number", "none", { text: "Nobody can tell which aircraft it is.", kind: "bad" }));
  const number = identity.operator_id;
  rows.push(...row("Operator", number.operator_id || "none",
    number.operator_id ? validity(number.validity, "The format is right.") : { text: "Nobody can tell who flies it.", kind: "bad" }));
  if (identity.self_id.description) rows.push(...row("Description", identity.self_id.description));
  rows.push(...row("Position", place(position), positionAside(position)));
  if (place(position)) {
    const height = position.height_m === null ? "unknown"
      : `${position.height_m.toFixed(0)} m above ${position.height_above === "ground" ? "ground" : "the take-off place"}`;
    rows.push(...row("Height", height));
    rows.push(...row("Speed", position.speed_mps === null ? "unknown" : `${position.speed_mps.toFixed(1)} m/s`));
  }
  rows.push(...row("Operator's place", place(operator),
    operator.location_type === "takeoff" && place(operator) ? { text: "the take-off place" } : { text: SAID_BY[operator.source] }));
  const unknown = aircraft.speaks ? "unknown: no HEARTBEAT from the autopilot" : "no autopilot heard";
  rows.push(...row("State", aircraft.armed === null ? unknown : aircraft.armed ? "armed" : "disarmed"));
  fill($("aircraft-list"), ...rows);
}

// ---- operator number and serial number ----

const fields = { operator: { known: "" }, serial: { known: "" } };

function changedFields() {
  return Object.keys(fields).filter((name) => $(name).value.trim() !== fields[name].known);
}

function showSettings(daemon) {
  const configured = daemon.identity.basic_ids.find((id) => id.source === "configuration");
  const number = daemon.identity.operator_id;
  const known = { operator: number.source === "configuration" ? number.operator_id : "",
                  serial: configured ? configured.uas_id : "" };
  for (const name of Object.keys(fields)) {
    // What is being typed stays.
    if ($(name).value.trim() === fields[name].known) $(name).value = known[name] || "";
    fields[name].known = known[name] || "";
  }
  allowSave();
}

let saving = false;

function allowSave() {
  $("settings-form").querySelector("button").disabled = saving || changedFields().length === 0;
}

// odidctl's sentences are for a terminal: what the page shows already is left out.
function plain(line) {
  return sentence(line.replace(/^odidctl: /, "").replace(/^(error|warning|note): /, "")
    .replace(/^\[\w+\] \w+( = )?(: )?/, ""));
}

function kindOf(result) {
  if (!result.done) return "bad";
  return result.said.some((line) => /^(warning|odidctl): /.test(line)) ? "warn" : "good";
}

async function save(event) {
  event.preventDefault();
  const names = changedFields();
  const values = Object.fromEntries(names.map((name) => [name, $(name).value.trim()]));
  saving = true;
  allowSave();
  for (const name of Object.keys(fields)) say($(`${name}-said`), "", ...(names.includes(name) ? ["Saving …"] : []));
  try {
    const answer = await ask("POST", "api/settings", values);
    for (const name of names) {
      say($(`${name}-said`), kindOf(answer[name]), ...answer[name].said.map(plain));
      // The number's secret part leaves the screen; what counts comes with the next status.
      if (answer[name].done) fields[name].known = $(name).value = values[name].replace(/-.*$/, "");
    }
  } catch (error) {
    for (const name of names) say($(`${name}-said`), "bad", sentenceOf(error));
  }
  saving = false;
  allowSave();
}

// ---- software and update ----

// The outcome stands below until the next update, whatever happens in between.
const OUTCOMES = { "installed": ["Installed", "good"], "refused": ["Refused", "bad"], "rolled-back": ["Rolled back", "bad"] };

function showSoftware(answer) {
  fill($("software-list"),
    ...row("Version", answer.version),
    ...row("Slot", answer.slot && answer.slot.toUpperCase(),
      answer.update && answer.update.state === "trial" ? { text: answer.update.sentence, kind: "warn" } : null));
  const last = answer.last_update;
  $("last-update").hidden = !last;
  if (last) {
    const [word, kind] = OUTCOMES[last.outcome] || [last.outcome, ""];
    mark($("last-update"), kind);
    write($("last-update-title"), `Last update: ${word}`);
    const versions = last.to ? ` (${last.from} → ${last.to}, ${when(last.time)})` : ` (${when(last.time)})`;
    write($("last-update-text"), `${last.sentence}${versions}`);
  }
}

// { request, begun, before: the last result's mark then, sent, installing, stopped: why, quiet: since when nothing
// goes on though all is sent }
let upload = null;

function showProgress(label, percent, text) {
  $("progress").hidden = false;
  write($("progress-label"), label);
  write($("progress-text"), text);
  if (percent === null || percent === undefined) $("progress-bar").removeAttribute("value");
  else $("progress-bar").value = percent;
}

function left(percent, seconds) {
  const parts = [];
  if (percent !== null && percent !== undefined) parts.push(`${Math.floor(percent)} %`);
  if (seconds !== null && seconds !== undefined) parts.push(`about ${duration(seconds)} left`);
  return parts.join(", ");
}

const busyStates = ["checking", "installing", "waiting-for-reboot"];
const cancellable = ["checking", "installing"];

function showUpdate(answer) {
  const update = answer.update || { state: "idle" };
  const busy = busyStates.includes(update.state);
  restarting = update.state === "waiting-for-reboot" || (restarting && busy);
  if (busy && (!upload || upload.sent || update.percent !== null)) {
    // Better than what has been sent: part of that lies in buffers still.
    showProgress(update.sentence || "Installing", update.percent, left(update.percent, update.seconds_left));
  }
  if (upload && busy) upload.quiet = performance.now();
  $("cancel").hidden = !(upload && !upload.sent) && !cancellable.includes(update.state);
  if (upload && !upload.sent) {
    upload.installing = busy && update.percent !== null;
    // Refused while it is still being sent: the sentence is there before the last octet is.
    if (ended(answer) && answer.last_update.outcome === "refused") endUpload("");
  } else if (upload && !busy && ended(answer)) {
    endUpload("");
  } else if (upload && !busy && performance.now() > upload.quiet + (upload.stopped ? 3 : 15) * POLL_MS) {
    endUpload("bad", upload.stopped || "The file was sent, but nothing says what became of it. Switch the power off and " +
      "on, and look here again.");
  } else if (!upload && !busy) {
    $("progress").hidden = true;
  }
  $("bundle").disabled = busy || upload !== null;
  $("update-form").querySelector("button").disabled = busy || upload !== null || !$("bundle").files.length;
}

// Is there a result that wasn't there when the upload began? It says more than we could.
function ended(answer) {
  return answer.last_update !== null && answer.last_update_mark !== upload.before;
}

function endUpload(kind, ...sentences) {
  const over = upload;
  upload = null;
  if (over && !over.sent) over.request.abort();
  $("cancel").hidden = true;
  $("progress").hidden = true;
  $("bundle").disabled = false;
  $("bundle").value = "";
  say($("update-said"), kind, ...sentences);
}

function sending(event) {
  if (!upload || upload.installing) return;
  const seconds = (performance.now() - upload.begun) / 1000;
  const rate = event.loaded / Math.max(seconds, 0.1);
  const percent = event.total ? event.loaded / event.total * 100 : null;
  // The first second's rate says nothing yet.
  showProgress("Sending to the aircraft", percent, left(percent, seconds > 1 ? (event.total - event.loaded) / rate : null));
}

// Everything is with the updater, or it was refused, or the way broke.
function sent(request) {
  if (!upload || upload.request !== request) return;
  let told = null;
  try {
    told = JSON.parse(request.responseText).sentence;
  } catch {
    // Nothing came back.
  }
  if (request.status === 202 || request.status === STOPPED) {
    upload.sent = true;
    $("cancel").hidden = true;
    // Why it stopped is told by the result, a moment later.
    upload.quiet = performance.now();
    if (request.status === STOPPED) upload.stopped = told;
    showProgress(request.status === STOPPED ? "It stopped; looking why" : "The aircraft checks and installs it", null, "");
    return;
  }
  if (request.status === 401) showLogin("");
  endUpload("bad", told || "The connection broke before the whole file was sent; nothing was installed. " +
    "Go nearer, and try again.");
}

function install(event) {
  event.preventDefault();
  const file = $("bundle").files[0];
  if (!file) return;
  if (file.size === 0 || file.size > BUNDLE_MAX) {
    say($("update-said"), "bad", `${file.name} is ${file.size ? "far too large" : "empty"}: that is no update. ` +
      "An update's name ends in .swu. Nothing was sent.");
    return;
  }
  const request = new XMLHttpRequest(); // fetch() doesn't tell how far it is
  upload = { request, begun: performance.now(), sent: false, before: status && status.last_update_mark };
  say($("update-said"), "");
  request.open("POST", "api/update");
  request.setRequestHeader("X-Odid-Page", "1");
  request.setRequestHeader("Content-Type", "application/octet-stream");
  request.upload.onprogress = sending;
  request.onloadend = () => sent(request);
  request.send(file);
  $("cancel").hidden = false;
  $("bundle").disabled = true;
  $("update-form").querySelector("button").disabled = true;
  showProgress("Sending to the aircraft", 0, "");
}

// What isn't sent yet ends with the sending; else, and whoever gave it, the aircraft is asked.
async function cancel() {
  if (upload && !upload.sent) {
    endUpload("", "Sending was cancelled. A file that arrived by half isn't installed.");
    return;
  }
  try {
    await ask("DELETE", "api/update");
  } catch (error) {
    say($("update-said"), "bad", sentenceOf(error));
  }
}

// ---- flight records ----

async function showFlights() {
  say($("flights-said"), "");
  try {
    const flights = await ask("GET", "api/flights");
    fill($("flight-list"), ...flights.map((flight) => {
      const name = String(flight.number).padStart(5, "0");
      const text = `${flight.duration_s === null ? "" : duration(flight.duration_s)}` +
        `${flight.armed_s ? `, armed ${duration(flight.armed_s)}` : flight.untold_s ? "" : ", never armed"}`;
      return element("li", {}, element("strong", {}, `${flight.number}: ${flight.start_utc ? when(flight.start_utc) : "clock unknown"}`),
        element("div", {}, sentence(flight.verdict)), element("div", { className: "hint" }, text),
        element("a", { href: `api/flights/${name}.jsonl`, download: `flight-${name}.jsonl` }, `Download record ${flight.number}`));
    }));
    if (!flights.length) say($("flights-said"), "", "No flight is recorded yet.");
  } catch (error) {
    say($("flights-said"), "bad", sentenceOf(error));
  }
}

// ---- password ----

function showLogin(sentenceToSay) {
  $("page").hidden = true;
  $("leave").hidden = true;
  $("login").hidden = false;
  say($("login-said"), "bad", ...(sentenceToSay ? [sentenceToSay] : []));
  document.title = "Remote ID";
  $("password").focus();
}

function showPage() {
  $("login").hidden = true;
  $("page").hidden = false;
  $("leave").hidden = false;
}

async function login(event) {
  event.preventDefault();
  const button = $("login-form").querySelector("button");
  button.disabled = true;
  try {
    await ask("POST", "api/session", { password: $("password").value });
    $("password").value = "";
    say($("login-said"), "");
    poll();
  } catch (error) {
    say($("login-said"), "bad", sentenceOf(error));
    $("password").select();
  }
  button.disabled = false;
}

async function leave() {
  try {
    await ask("DELETE", "api/session");
  } finally {
    location.reload();
  }
}

// ---- once a second ----

let timer = 0;
let missed = 0;

function show(answer) {
  status = answer;
  heardAt = Date.now();
  document.body.classList.remove("stale");
  showPage();
  showVerdict(answer.daemon, answer.daemon_silence);
  showProblems(answer);
  if (answer.daemon) {
    showChannels(answer.daemon);
    showAircraft(answer.daemon);
    showSettings(answer.daemon);
  }
  showSoftware(answer);
  showUpdate(answer);
}

async function poll() {
  clearTimeout(timer);
  try {
    show(await ask("GET", "api/status"));
    missed = 0;
  } catch (error) {
    if (error instanceof Refused && error.code === 401) {
      showLogin(status ? "Give the password again: the page was closed, or not used for half an hour." : "");
      status = null;
      return;
    }
    // One answer may be lost on the way; before the first one there is nothing to keep.
    missed += 1;
    if (missed > 1 || !status) {
      showPage();
      showSilence();
    }
  }
  timer = setTimeout(poll, POLL_MS);
}

$("login-form").addEventListener("submit", login);
$("leave").addEventListener("click", leave);
$("settings-form").addEventListener("submit", save);
$("settings-form").addEventListener("input", allowSave);
$("update-form").addEventListener("submit", install);
$("bundle").addEventListener("change", () => {
  $("update-form").querySelector("button").disabled = upload !== null || !$("bundle").files.length;
});
$("cancel").addEventListener("click", cancel);
$("flights-show").addEventListener("click", showFlights);
poll();
