/** What the page could not show: values of another kind than their members have, or out of their range. Members without a control are the service's to judge. */
import { FIELDS } from "./fields.js";

const LENGTHS = { "camera.position_m": 3, "clouds.wind_mps": 2, "ground.albedo": 3 };
/** Taken over into the effective radius; its range is that of openapi.yaml. */
const RADIUS = { min: 0.045, max: 10, initial: 0.5 };

const isNumber = (value, { min, max }) => typeof value === "number" && value >= min && value <= max;
const range = ({ min, max }) => `between ${min} and ${max}`;

/** @param {import("./fields.js").Field} field */
function faultOfField(value, field) {
	if (field.choices)
		return field.choices.some(([choice]) => choice === value) ? "" : `is none of ${field.choices.map(([choice]) => choice).join(", ")}`;
	if (typeof field.initial === "boolean")
		return typeof value === "boolean" ? "" : "is neither true nor false";
	if (typeof field.initial === "string" && value === field.initial)
		return "";
	return isNumber(value, field) ? "" : `is no number ${range(field)}${typeof field.initial === "string" ? ` nor ${field.initial}` : ""}`;
}

function faultOfTime(value) {
	const [, date] = String(value).match(/^(\d{4}-\d\d-\d\d)[Tt ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:[Zz]|[-+]\d\d:\d\d)$/) ?? [];
	return Number.isFinite(Date.parse(`${date}T00:00:00Z`)) ? "" : "is no time such as 2026-06-21T14:30:00+01:00";
}

/** @param {string} path a member by its dotted name  @returns {string} what is wrong with it; empty: nothing that is known here */
export function faultOf(path, value) {
	if (path === "sun.time")
		return faultOfTime(value);
	if (path in LENGTHS) {
		const faults = value.map((item, i) => (FIELDS.has(`${path}.${i}`) ? faultOfField(item, FIELDS.get(`${path}.${i}`)) : ""));
		return value.length === LENGTHS[path] ? (faults.find(Boolean) ?? "") : `is not of ${LENGTHS[path]} numbers`;
	}
	const field = path === "dsd.characteristic_radius_um" ? RADIUS : FIELDS.get(path);
	return field ? faultOfField(value, field) : "";
}
