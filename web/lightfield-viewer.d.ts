// SPDX-License-Identifier: LGPL-2.1-or-later

/** Where a virtual camera stands and looks: metres and degrees; x to the right, y down, z forward. */
export interface LightfieldView {
  x: number;
  y: number;
  z: number;
  /** About y, then pitch about x, then roll about z. */
  yaw: number;
  pitch: number;
  roll: number;
  /** Vertical field of view. */
  fov: number;
  /** Metres to what is sharp, along the line of sight. */
  focusDistance: number;
}

/** For one eye; for two beside each other; or for red-cyan glasses. */
export type LightfieldEyes = 'one' | 'side' | 'anaglyph';

/** What the server counts, told once a second; docs/web-interface.md of gst-lightfield has all of it. */
export interface LightfieldStatistics {
  pictures: number;
  incomplete: number;
  /** Share of the picture that cameras see, 0..1. */
  coverage?: number;
  /** Milliseconds from a request until its picture is composed. */
  pictureMs: number;
  /** Bits per second. */
  bitRate: number;
  frameRate: number;
  sizeDivisor: number;
  /** Share of packets, 0..1. */
  loss: number;
  roundTripMs: number;
  /** What the latest picture shows: the pose in metres and as w, x, y, z, and more (docs/web-interface.md). */
  picture?: { sequence: number; position: number[]; orientation: number[]; complete: boolean; [name: string]: unknown };
  /** Of the server's own cameras; where none works the picture stays as it was. */
  cameras?: { count: number; working: number };
  /** Hosts with cameras, where these are not the server's own; `silent` counts from 0. */
  nodes?: { count: number; silent: number[] };
  [name: string]: unknown;
}

export interface LightfieldFailure {
  /** For people, as the element shows it. */
  message: string;
  /** As the server or the browser says it. */
  cause: string;
  /** Of HTTP; missing where the server was not reached. */
  status?: number;
  /** For programs: "token", "full", "filming", "path", "origin", "rate", ... */
  reason?: string;
  /** Seconds until the element tries again by itself; Infinity: it does not. */
  retryAfter: number;
}

export interface LightfieldViewerEventMap {
  /** The first picture is on the screen; pixels. */
  'first-frame': CustomEvent<{ width: number; height: number }>;
  /** A picture of another view is on the screen. `by`: who moved the view last, with the element's controls or methods. */
  'view-change': CustomEvent<{ view: LightfieldView; by: 'person' | 'script' }>;
  /** What is sharp in it is at another distance. */
  'focus-change': CustomEvent<{ focusDistance: number }>;
  error: CustomEvent<LightfieldFailure>;
  connected: CustomEvent<null>;
  disconnected: CustomEvent<{ reason: string }>;
  statistics: CustomEvent<LightfieldStatistics>;
  /** The server has another rig, after a calibration say; `hash` tells it from others. The view stays. */
  rig: CustomEvent<{ hash: string }>;
}

/** `<lightfield-viewer>`: a picture of a light field, and what flies it. */
export class LightfieldViewer extends HTMLElement {
  /** The server's WHEP endpoint; without it that of the server that this script came from. */
  src: string | null;
  /** Bearer token, where the server wants one. */
  token: string | null;
  /** URL of a picture that is shown until there is one. */
  poster: string | null;
  /** What the picture shows, for who can't see it. */
  alt: string | null;
  eyes: LightfieldEyes | null;
  /** Metres between two eyes, 0 or more; null: 0.063. */
  eyeDistance: number | null;
  /** Name of a camera path that the server flies. */
  path: string | null;
  /** The bar, and flying by mouse, touch, keys and gamepad. */
  controls: boolean;
  /** Begins by itself as soon as it is in sight. */
  autoplay: boolean;
  /** Reads the view from the page's address, and writes it there where somebody shares it. */
  shares: boolean;
  /** Maximum width of the picture to request, in pixels of each eye; 64 at least. */
  maxWidth: number | null;
  /** STUN and TURN servers; null: those of the attribute, or that the server names. */
  iceServers: RTCIceServer[] | null;
  /** The view that is seen; null before there is one. Setting it to what it was set to before changes nothing. */
  get view(): LightfieldView | null;
  set view(view: Partial<LightfieldView> | string | null);
  /** Metres to what is sharp. Setting it focuses there, also to the same number as before. */
  get focusDistance(): number | null;
  set focusDistance(metres: number | null);
  /** A picture has been shown. */
  readonly loaded: boolean;
  readonly connected: boolean;
  readonly paused: boolean;
  /** The latest; {} before there are any. */
  readonly statistics: Partial<LightfieldStatistics>;
  /** Of the stream, for who looks into it; null without one. */
  readonly connection: { readonly peer: RTCPeerConnection; readonly channel: RTCDataChannel } | null;
  /** The element that says what is in the way; hidden where nothing is. */
  readonly status: HTMLElement;

  /**
   * Numbers that are not given stay. Ends with the view when it is on the screen, or one that was set later. Rejected with
   * TypeError or RangeError for a wrong number, with InvalidStateError while the server flies a path, and with AbortError
   * when `src` or `path` changes before the view is seen.
   */
  setView(view: Partial<LightfieldView>): Promise<LightfieldView>;
  /** Flies to `view` and `focus`; numbers that these do not give are those of the server's home. */
  goHome(): void;
  /** Lets go of the stream and asks for another one, where it was. */
  reconnect(): void;
  /** Copies a link to the view where that is allowed, and returns it. With `share` it becomes the page's address, too. */
  share(): Promise<string>;
  /**
   * Focuses on what is seen at a place in the window, as `event.clientX`, like a click. False: not connected, or the server
   * flies a path.
   */
  focusAt(clientX: number, clientY: number): boolean;
  /** The picture that is shown. Rejected where there is none. */
  toBlob(options?: { type?: string; quality?: number }): Promise<Blob>;
  /** Begins, where there is no `autoplay`. */
  play(): void;
  /** Lets the seat on the server go; the picture stays. */
  pause(): void;

  addEventListener<K extends keyof LightfieldViewerEventMap>(type: K,
    listener: (this: LightfieldViewer, event: LightfieldViewerEventMap[K]) => unknown,
    options?: boolean | AddEventListenerOptions): void;
  addEventListener<K extends Exclude<keyof HTMLElementEventMap, keyof LightfieldViewerEventMap>>(type: K,
    listener: (this: LightfieldViewer, event: HTMLElementEventMap[K]) => unknown,
    options?: boolean | AddEventListenerOptions): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject,
    options?: boolean | AddEventListenerOptions): void;
  removeEventListener<K extends keyof LightfieldViewerEventMap>(type: K,
    listener: (this: LightfieldViewer, event: LightfieldViewerEventMap[K]) => unknown,
    options?: boolean | EventListenerOptions): void;
  removeEventListener<K extends Exclude<keyof HTMLElementEventMap, keyof LightfieldViewerEventMap>>(type: K,
    listener: (this: LightfieldViewer, event: HTMLElementEventMap[K]) => unknown,
    options?: boolean | EventListenerOptions): void;
  removeEventListener(type: string, listener: EventListenerOrEventListenerObject,
    options?: boolean | EventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    'lightfield-viewer': LightfieldViewer;
  }
}

/** What JSX sets: properties, and listeners by the events' own names, as `onview-change`. */
export type LightfieldViewerProps = Partial<Pick<LightfieldViewer, 'src' | 'token' | 'poster' | 'alt' | 'eyes' | 'eyeDistance' |
  'path' | 'controls' | 'autoplay' | 'shares' | 'maxWidth' | 'iceServers' | 'focusDistance'>> & {
  view?: Partial<LightfieldView> | string | null;
} & {
  [Name in keyof LightfieldViewerEventMap as `on${Name}`]?: (event: LightfieldViewerEventMap[Name]) => void;
};

// Of React 19 and later. Where it is not installed there is no such module, and no harm.
// @ts-ignore
declare module 'react' {
  namespace JSX {
    interface IntrinsicElements {
      // @ts-ignore
      'lightfield-viewer': LightfieldViewerProps & Omit<DetailedHTMLProps<HTMLAttributes<LightfieldViewer>, LightfieldViewer>, 'onError'>;
    }
  }
}
