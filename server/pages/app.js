/** The page: what belongs together is put together here. */
import { CameraHand } from "./picture/camera.js";
import { Comparison } from "./picture/compare.js";
import { Probe } from "./picture/probe.js";
import { RenderLoop } from "./picture/loop.js";
import { Sizes } from "./picture/size.js";
import { Stage } from "./picture/stage.js";
import { Viewer } from "./picture/viewer.js";
import { Animation } from "./panels/animation.js";
import { Controls } from "./panels/controls.js";
import { Dome } from "./panels/dome.js";
import { Droplets } from "./panels/droplets.js";
import { Exposure } from "./panels/exposure.js";
import { askForKey } from "./panels/key_dialog.js";
import { LayersPanel } from "./panels/layers_panel.js";
import { Presets } from "./panels/presets.js";
import { Share } from "./panels/share.js";
import { SunPlace } from "./panels/sun_place.js";
import { Tabs } from "./panels/tabs.js";
import { followTheme } from "./panels/theme.js";
import { TimingBar } from "./panels/timing_bar.js";
import { fromQuery, toQuery } from "./scene/address.js";
import { FIELDS } from "./scene/fields.js";
import { Scene } from "./scene/scene.js";
import { inWords } from "./scene/words.js";
import { Problem, fetchJson } from "./service/api.js";

const $ = (id) => document.getElementById(id);

const scene = new Scene();
const stage = new Stage($("stage"));
const sizes = new Sizes(() => stage.box);
const viewer = new Viewer(scene, stage, sizes);
const controls = new Controls(scene);
const loop = new RenderLoop({ draw: (kind, signal) => viewer.draw(kind, signal), failed });
const comparison = new Comparison(stage, viewer);
const timing = new TimingBar($("timing"));
const dome = new Dome(scene, $("dome"), loop);
const sun = new SunPlace(scene, dome, $("panel-sun"));
const droplets = new Droplets(scene, $("panel-droplets"));
const exposure = new Exposure(scene, viewer, document.querySelector(".exposure"), loop, failed);
const share = new Share(scene, $("panel-share"), { say, failed });
const layers = new LayersPanel(scene, $("layers"), chooseLayer);
const presets = new Presets($("presets"), choosePreset, () => stage.element.dataset.working === "" && !animation.playing);
const animation = new Animation(scene, document.querySelector(".play"), {
	draw: (signal) => viewer.draw("quick", signal),
	begin: () => loop.hold(),
	end: () => {
		loop.release();
		loop.outgrown();
	},
	place: () => sun.begin(),
	failed,
});
let tabs = null;
let retry = 0;
/** What the page itself found wrong, such as in its address: told until something is changed, whatever is drawn. */
let told = null;

/** What screen readers are told. */
function say(text) {
	$("status").textContent = text;
}

/** @param {Error & {errors?: {pointer: string, detail: string}[], retryAfter?: number, status?: number}} error */
function failed(error) {
	if (!(error instanceof Problem))
		console.error(error);
	const others = controls.mark(error.errors ?? []);
	const seconds = secondsToRetry(error);
	const text = others.length ? others.map(({ pointer, detail }) => `${pointer}: ${detail}`).join("; ") : kindly(error, seconds);
	const notice = { title: error.title || "That did not work.", text };
	stage.say(notice);
	if (error.status === 0 && !seconds)
		told = notice;
	clearTimeout(retry);
	if (seconds)
		retry = setTimeout(() => loop.changed(), 1000 * seconds);
}

/** 0: asking again is of no use. No status: there was no answer. */
function secondsToRetry({ status, retryAfter = 0 }) {
	if ([429, 503].includes(status))
		return Math.max(retryAfter, 1);
	return status === 0 ? retryAfter : 0;
}

function labelOf(pointer) {
	const field = FIELDS.get(pointer.slice(1).replaceAll("/", "."));
	return field ? `${field.label}:` : pointer;
}

function kindly(error, seconds) {
	const [first] = error.errors ?? [];
	if (first)
		return `${labelOf(first.pointer)} ${first.detail}. The picture is the last one that could be had.`;
	return seconds ? `${error.message} Asking again in ${seconds} s.` : error.message;
}

viewer.drawn = (drawn) => {
	clearTimeout(retry);
	stage.say(told);
	controls.mark([]);
	exposure.drawn(drawn.ev);
	if (drawn.kind !== "full")
		return;
	timing.show(drawn);
	$("picture").setAttribute("aria-label", inWords(scene, dome.sun));
	say(`Picture of ${drawn.width} by ${drawn.height} pixels, in ${Math.round(drawn.took)} milliseconds.`);
	if (tabs?.current === "layers")
		layers.follow();
	setTimeout(() => presets.draw());
};

function chooseLayer(layer) {
	viewer.layer = layer;
	loop.changed({ afresh: true });
}

function choosePreset(members) {
	animation.stop();
	told = null;
	scene.replace(members);
}

/** Parts of the page that are of use for some scenes alone. */
function showParts() {
	$("ground-albedo").hidden = scene.value("ground.type") !== "lambert";
	$("camera-direction").hidden = scene.isPanorama;
	stage.element.classList.toggle("panorama", scene.isPanorama);
}

let addressTimer = 0;
let written = "";
function keepAddress() {
	clearTimeout(addressTimer);
	addressTimer = setTimeout(() => {
		written = `#${toQuery(scene.members())}`;
		history.replaceState(null, "", written);
	}, 250);
}

/** The scene that an address says behind its #. */
function takeAddress() {
	const { members, wrong } = fromQuery(location.hash.slice(1));
	told = wrong.length ? { title: "Left out of the address:", text: wrong.join("; ") } : null;
	scene.replace(members);
	stage.say(told);
}

scene.addEventListener("change", ({ detail }) => {
	if (detail.paths)
		told = null;
	showParts();
	dome.follow();
	share.follow();
	keepAddress();
	if (!exposure.takes(detail.paths) && !animation.playing)
		loop.changed({ afresh: !detail.paths });
});

$("compare").addEventListener("change", ({ target }) => {
	comparison.choose(target.value, scene);
	loop.changed({ afresh: true });
});
/* The link to the controls is no scene. */
addEventListener("hashchange", () => (location.hash === "#controls" ? keepAddress() : location.hash !== written && takeAddress()));
new ResizeObserver(() => {
	if (stage.element.dataset.shows && sizes.output(scene, "full").width !== stage.canvases.picture.width)
		loop.outgrown();
}).observe(stage.element);
new CameraHand(scene, stage, loop);
new Probe(scene, viewer, $("stage-help"), { sun: () => dome.sun, failed });
followTheme($("theme"));
tabs = new Tabs($("tabs"), (name) => name === "layers" && layers.follow());
askForKey($("key-dialog"), () => {
	loop.changed({ afresh: true });
	share.follow();
	begin();
});

async function begin() {
	droplets.follow();
	presets.load().catch(() => {});
	const ready = await fetchJson("readyz").catch(() => ({}));
	sizes.software = ready.software ?? true;
	$("device").textContent = ready.renderer?.split(" (")[0] ?? "";
	$("device").title = ready.renderer ?? "";
}

takeAddress();
begin();
