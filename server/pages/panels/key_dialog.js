/** Asks for the key where the service does. It is kept until the tab is closed, and goes nowhere but to the service. */
import { key } from "../service/api.js";

/** @param {HTMLDialogElement} dialog  @param {() => void} given */
export function askForKey(dialog, given) {
	const input = dialog.querySelector("input");
	document.addEventListener("key-wanted", () => {
		dialog.querySelector(".wrong").hidden = !key.get();
		if (!dialog.open)
			dialog.showModal();
	});
	dialog.addEventListener("close", () => {
		if (dialog.returnValue !== "given")
			return;
		key.set(input.value.trim());
		given();
	});
	/* Enter presses the first button of a form; here it means the second. */
	input.addEventListener("keydown", (event) => {
		if (event.key === "Enter") {
			event.preventDefault();
			dialog.close("given");
		}
	});
}
