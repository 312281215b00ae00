// SPDX-License-Identifier: LGPL-2.1-or-later
// Shows all cameras live, arranged like the array, with names and health. The page highlights a camera if a hand moves
// in front of the lens. If the server allows it (lf-rig identify), two cameras can be swapped by dragging, or by
// selecting them in turn with clicks or keys. While a moving light is recorded (lf-rig record --lights), the image
// regions it has reached are green, and a text explains where to move the light next.

const kPollInterval = 200;  // milliseconds
const kRequestTimeout = 5000;  // milliseconds
const mosaic = document.getElementById('mosaic'), told = document.getElementById('told');
const asks = document.getElementById('asks');
const tiles = new Map();
const tokenOfAddress = () => new URLSearchParams(location.hash.slice(1)).get('token') ?? '';
let token = tokenOfAddress(), swaps = false, chosen = null, turns = 0;

const ask = async (name, options = {}) => {
  const headers = { ...options.headers, ...token && { Authorization: `Bearer ${token}` } };
  const response = await fetch(name, { ...options, headers, signal: AbortSignal.timeout(kRequestTimeout) });
  if (response.status === 401) asks.hidden = false;
  if (!response.ok) throw new Error((await response.text()).trim() || response.statusText);
  asks.hidden = true;
  return response;
};
asks.addEventListener('submit', event => {
  event.preventDefault();
  token = asks.querySelector('input').value;
  turn();
});
addEventListener('hashchange', () => {
  token = tokenOfAddress();
  turn();
});

function tileOf({ id, name, column, row }, [width, height]) {
  const tile = document.createElement('button');
  tile.className = 'tile';
  tile.type = 'button';
  tile.dataset.id = id;
  tile.style.gridColumn = column + 1;
  tile.style.gridRow = row + 1;
  const canvas = Object.assign(document.createElement('canvas'), { width, height });
  const words = ['name', 'health'].map(kind => Object.assign(document.createElement('span'), { className: kind }));
  words[0].textContent = name || `camera ${id}`;
  tile.append(canvas, ...words);
  tile.addEventListener('click', () => choose(id));
  tile.addEventListener('dragstart', event => event.dataTransfer.setData('text/plain', String(id)));
  tile.addEventListener('dragover', event => {
    if (!swaps) return;
    event.preventDefault();
    tile.classList.add('over');
  });
  for (const end of ['dragleave', 'drop']) tile.addEventListener(end, () => tile.classList.remove('over'));
  tile.addEventListener('drop', event => {
    event.preventDefault();
    swap(Number(event.dataTransfer.getData('text/plain')), id);
  });
  mosaic.append(tile);
  return tile;
}

function choose(id) {
  if (!swaps) return;
  const first = chosen;
  chosen = first === null ? id : null;
  for (const [other, tile] of tiles) tile.classList.toggle('chosen', other === chosen);
  if (first !== null && first !== id) swap(first, id);
}

async function swap(a, b) {
  if (a === b || !tiles.has(a) || !tiles.has(b)) return;
  const name = id => tiles.get(id).querySelector('.name').textContent;
  try {
    await ask('swap', { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify({ a, b }) });
    told.textContent = `Swapped the cameras at ${name(a)} and ${name(b)} in the rig file.`;
  } catch (error) {
    told.textContent = `The cameras were not swapped: ${error.message}`;
  }
}

function show(state, picture) {
  const [width, height] = state.tile;
  if (tiles.size !== state.cameras.length || state.cameras.some(({ id }) => !tiles.has(id))) {
    mosaic.replaceChildren();
    tiles.clear();
    for (const camera of state.cameras) tiles.set(camera.id, tileOf(camera, state.tile));
    mosaic.style.setProperty('--columns', state.columns);
    mosaic.style.setProperty('--largest', `${width * 2}px`);
    // The largest size that fits all tiles, with two lines of text each, into the window below the instructions.
    const fits = `((100vh - ${state.told ? 150 : 70}px) / ${state.rows} - 46px) * ${width / height}`;
    mosaic.style.setProperty('--fits', fits);
  }
  swaps = state.swaps === true;
  if (state.told && told.textContent !== state.told) told.textContent = state.told;
  told.classList.toggle('asks', state.told !== undefined);
  for (const { id, column, row, rate, problem, lit, came, wanted } of state.cameras) {
    const tile = tiles.get(id);
    tile.draggable = swaps;
    tile.classList.toggle('lit', lit);
    tile.classList.toggle('ill', problem !== '');
    tile.classList.toggle('done', came !== undefined && wanted === '');
    const health = tile.querySelector('.health'), words = problem || wanted || `${rate.toFixed(1)} frames/s`;
    if (health.textContent !== words) health.textContent = words;
    const context = tile.querySelector('canvas').getContext('2d');
    context.drawImage(picture, column * width, row * height, width, height, 0, 0, width, height);
    if (came) showPlaces(context, came, state.places, width, height);
  }
}

function showPlaces(context, came, [columns, rows], width, height) {
  const w = width / columns, h = height / rows;
  came.forEach((yes, i) => {
    const x = i % columns * w, y = Math.floor(i / columns) * h;
    context.fillStyle = 'rgba(60, 200, 90, 0.4)';
    context.strokeStyle = 'rgba(255, 255, 255, 0.35)';
    if (yes) context.fillRect(x, y, w, h);
    else context.strokeRect(x + 1.5, y + 1.5, w - 3, h - 3);
  });
}

// If the server requires a token, polling pauses until the person enters the token.
async function turn() {
  const latest = ++turns;
  try {
    const [state, jpeg] = await Promise.all([
      ask('mosaic.json').then(response => response.json()), ask('mosaic.jpg').then(response => response.blob())]);
    show(state, await createImageBitmap(jpeg));
    if (told.dataset.failed && !state.told) told.textContent = 'Wave at a camera to highlight it.';
    delete told.dataset.failed;
  } catch (error) {
    told.textContent = asks.hidden ? `Can't load the cameras: ${error.message}` : 'The server asks for a token.';
    told.dataset.failed = 'yes';
  }
  if (latest === turns && asks.hidden) setTimeout(turn, kPollInterval);
}
turn();
