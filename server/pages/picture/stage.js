/** Where pictures are shown: two canvases one over the other, a divider between them, and what is said about them. */

const number = (value) => value.toLocaleString("en", { maximumSignificantDigits: 3 });

export class Stage {
	/** @param {HTMLElement} element */
	constructor(element) {
		this.element = element;
		this.canvases = { picture: element.querySelector("#picture"), other: element.querySelector("#other") };
		this.divider = element.querySelector("#divider");
		this.notice = element.querySelector("#notice");
		this.key = element.querySelector("#scale");
	}

	get box() {
		return { width: this.element.clientWidth, height: this.element.clientHeight };
	}

	/** Where the picture is within the stage, CSS pixels. */
	get frame() {
		const { width, height } = this.box;
		const canvas = this.canvases.picture;
		const zoom = Math.min(width / canvas.width, height / canvas.height);
		return { width: canvas.width * zoom, height: canvas.height * zoom };
	}

	/** A pointer's place in the picture, from its upper left corner, 1 being its width and height; null beside it. */
	placeOf({ clientX, clientY }) {
		const box = this.element.getBoundingClientRect();
		const { width, height } = this.frame;
		const x = (clientX - box.left - (box.width - width) / 2) / width;
		const y = (clientY - box.top - (box.height - height) / 2) / height;
		return x >= 0 && x < 1 && y >= 0 && y < 1 ? { x, y } : null;
	}

	/** @param {"picture" | "other"} pane  @param {ImageBitmap | ImageData} image */
	draw(pane, image) {
		const canvas = this.canvases[pane];
		if (canvas.width !== image.width || canvas.height !== image.height) {
			canvas.width = image.width;
			canvas.height = image.height;
		}
		const context = canvas.getContext("2d");
		if (image instanceof ImageData) {
			context.putImageData(image, 0, 0);
		} else {
			context.drawImage(image, 0, 0);
			image.close();
		}
		const { width, height } = this.frame;
		this.element.style.setProperty("--frame-width", `${width}px`);
		this.element.style.setProperty("--frame-height", `${height}px`);
	}

	/** @param {"quick" | "full" | null} kind of the picture that is waited for */
	working(kind) {
		this.element.dataset.working = kind ?? "";
		this.element.setAttribute("aria-busy", String(kind === "full"));
	}

	/** What is shown, for whoever looks at the page from outside: tests, and scripts of users. */
	describe(kind, { width, height }, members) {
		const { output, ...scene } = members;
		Object.assign(this.element.dataset, { shows: kind, size: `${width}x${height}`, scene: JSON.stringify(scene) });
	}

	/** Names over the two halves; null: one picture. */
	compare(names) {
		this.element.classList.toggle("comparing", Boolean(names));
		this.divider.hidden = !names;
		if (names) {
			this.element.querySelector("#name-left").textContent = names[0];
			this.element.querySelector("#name-right").textContent = names[1];
		}
	}

	/** What the colours of a layer mean. */
	scale(scale) {
		this.key.hidden = !scale;
		if (!scale)
			return;
		const unit = scale.unit && ` ${scale.unit}`;
		this.key.querySelector(".from").textContent = number(scale.from) + unit;
		this.key.querySelector(".to").textContent = number(scale.to) + unit;
		this.key.querySelector(".how").textContent = scale.logarithmic ? "logarithmic" : "";
	}

	/** @param {{title: string, text: string} | null} said */
	say(said) {
		this.notice.hidden = !said;
		this.notice.querySelector("strong").textContent = said?.title ?? "";
		this.notice.querySelector("span").textContent = said?.text ?? "";
	}
}
