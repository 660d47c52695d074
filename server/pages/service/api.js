/** Calls of the service, with the key where it asks for one. */
import { readTiming } from "./timing.js";

const KEY = "stratus-key";
/** A daemon that is started again is there after some seconds. */
const LOST_S = 5;

/** An answer that is none: a problem (RFC 9457), or that there was no answer. */
export class Problem extends Error {
	/** @param {{status?: number, title?: string, detail?: string, errors?: {pointer: string, detail: string}[], retry_after_seconds?: number}} said */
	constructor(said) {
		super(said.detail || said.title || "The service did not say why.");
		this.status = said.status ?? 0;
		this.title = said.title ?? "";
		this.errors = said.errors ?? [];
		this.retryAfter = said.retry_after_seconds ?? 0;
	}
}

export const key = {
	get: () => sessionStorage.getItem(KEY) ?? "",
	set: (value) => (value ? sessionStorage.setItem(KEY, value) : sessionStorage.removeItem(KEY)),
};

/** Address of a call; relative to the page, so that a proxy may put all of it below a path. */
export const address = (call) => new URL(call, new URL(".", document.baseURI));

async function problemOf(response) {
	const type = response.headers.get("Content-Type") ?? "";
	const said = type.includes("json") ? await response.json().catch(() => ({})) : {};
	const retry = Number(response.headers.get("Retry-After")) || 0;
	return new Problem({ title: response.statusText, retry_after_seconds: retry, ...said, status: response.status });
}

/**
 * @param {string} call such as "v1/optics?dsd.gamma=7"
 * @param {{signal?: AbortSignal, priority?: "low" | "high", cache?: RequestCache}} [how]
 * @returns {Promise<Response>} whose status is 200; a Problem is thrown else, and AbortError when the signal says so
 */
export async function call(call, { signal, priority, cache } = {}) {
	const headers = key.get() ? { Authorization: `Bearer ${key.get()}` } : {};
	const response = await fetch(address(call), { headers, signal, priority, cache }).catch((error) => {
		if (error.name === "AbortError")
			throw error;
		throw new Problem({ title: "No answer", detail: "The service does not answer. Is it still running?", retry_after_seconds: LOST_S });
	});
	if (response.ok)
		return response;
	const problem = await problemOf(response);
	if (problem.status === 401)
		document.dispatchEvent(new CustomEvent("key-wanted"));
	throw problem;
}

/** Likewise, with the whole body and how long that took. */
export async function fetchBytes(what, how) {
	const began = performance.now();
	const response = await call(what, how);
	const blob = await response.blob();
	return { blob, took: performance.now() - began, timing: readTiming(response.headers.get("Server-Timing") ?? "") };
}

export async function fetchJson(what, how) {
	return (await call(what, how)).json();
}
