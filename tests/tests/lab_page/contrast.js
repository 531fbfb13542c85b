// Text whose contrast against what lies behind it is below `arguments[0]`, as sentences.
// Contrast as in WCAG 2.2. Disabled controls are exempt there and here.
const least = arguments[0];

// The browser itself turns any notation of a colour into numbers from 0 to 255, and alpha.
const canvas = new OffscreenCanvas(1, 1).getContext('2d', { willReadFrequently: true });
function numbers(colour) {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [red, green, blue, alpha] = canvas.getImageData(0, 0, 1, 1).data;
    return [red, green, blue, alpha / 255];
}

function over(front, back) {
    const alpha = front[3];
    return [0, 1, 2].map(k => front[k] * alpha + back[k] * (1 - alpha)).concat(1);
}

// What lies behind an element: the backgrounds of all that hold it, on the browser's own canvas.
function behind(element) {
    const layers = [];
    for (let e = element; e; e = e.parentElement) {
        layers.push(numbers(getComputedStyle(e).backgroundColor));
    }
    const dark = getComputedStyle(document.documentElement).colorScheme.includes('dark') &&
        matchMedia('(prefers-color-scheme: dark)').matches;
    const sheet = dark ? [18, 18, 18, 1] : [255, 255, 255, 1];
    return layers.reverse().reduce((back, front) => over(front, back), sheet);
}

function luminance(colour) {
    const [red, green, blue] = colour.slice(0, 3).map(value => {
        const part = value / 255;
        return part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
}

function contrast(a, b) {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
}

function opacity(element) {
    let product = 1;
    for (let e = element; e; e = e.parentElement) {
        product *= Number(getComputedStyle(e).opacity);
    }
    return product;
}

const faults = [];
const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
    const text = walker.currentNode.data.trim();
    const e = walker.currentNode.parentElement;
    const visible = e.checkVisibility({ opacityProperty: true, visibilityProperty: true });
    if (!text || !visible || e.closest(':disabled, [aria-disabled=true], script, style, title')) {
        continue;
    }
    // A browser draws the options of a closed list itself.
    if (e.closest('option')) {
        continue;
    }
    const style = getComputedStyle(e);
    const front = numbers(e.closest('svg') ? style.fill : style.color);
    front[3] *= opacity(e);
    const back = behind(e);
    const found = contrast(over(front, back), back);
    if (found < least - 0.005) {
        faults.push(`contrast ${found.toFixed(2)} of "${text.slice(0, 40)}" in ${e.tagName} ${e.className.baseVal ?? e.className}`);
    }
}
return [...new Set(faults)];
