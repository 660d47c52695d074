/** Tabs as the ARIA practices have them: arrows go from one to the next, and what is not shown is hidden. */
export class Tabs {
	/** @param {HTMLElement} list  @param {(name: string) => void} chosen */
	constructor(list, chosen) {
		this.list = list;
		this.tabs = [...list.querySelectorAll("[role=tab]")];
		this.chosen = chosen;
		for (const tab of this.tabs) {
			tab.addEventListener("click", () => this.#take(tab));
			tab.addEventListener("keydown", (event) => this.#key(event, tab));
		}
		this.choose(this.tabs[0]);
	}

	get current() {
		return this.tabs.find((tab) => tab.getAttribute("aria-selected") === "true")?.dataset.tab;
	}

	choose(tab) {
		for (const other of this.tabs) {
			const is = other === tab;
			other.setAttribute("aria-selected", String(is));
			other.tabIndex = is ? 0 : -1;
			document.getElementById(other.getAttribute("aria-controls")).hidden = !is;
		}
		this.chosen(tab.dataset.tab);
	}

	/** Along the list alone: the page stays where it is. */
	#reveal(tab) {
		const list = this.list.getBoundingClientRect();
		const box = tab.getBoundingClientRect();
		this.list.scrollLeft += Math.min(box.left - list.left, 0) + Math.max(box.right - list.right, 0);
	}

	#take(tab) {
		this.choose(tab);
		this.#reveal(tab);
	}

	#key(event, tab) {
		const at = this.tabs.indexOf(tab);
		const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: this.tabs.length - 1 }[event.key];
		if (to === undefined)
			return;
		event.preventDefault();
		const next = this.tabs[(to + this.tabs.length) % this.tabs.length];
		this.#take(next);
		next.focus();
	}
}
