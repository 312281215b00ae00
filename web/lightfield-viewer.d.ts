// SPDX-License-Identifier: LGPL-2.1-or-later

/** Pose, field of view and focus of a virtual camera: metres and degrees; x to the right, y down, z forward. */
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
  /** Distance to the plane in focus, along the optical axis, metres. */
  focusDistance: number;
}

/** One eye, two pictures side by side, or red-cyan glasses. */
export type LightfieldEyes = 'one' | 'side' | 'anaglyph';

/** Statistics of the server, once a second; docs/reference/web-interface.md of gst-lightfield lists all fields. */
export interface LightfieldStatistics {
  pictures: number;
  incomplete: number;
  /** Fraction of the picture that the cameras cover, 0..1. */
  coverage?: number;
  /** Milliseconds from a request until its picture is composed. */
  pictureMs: number;
  /** Bits per second. */
  bitRate: number;
  frameRate: number;
  sizeDivisor: number;
  /** Fraction of lost packets, 0..1. */
  loss: number;
  roundTripMs: number;
  /** The latest picture: position in metres, orientation as w, x, y, z, and more (docs/reference/web-interface.md). */
  picture?: { sequence: number; position: number[]; orientation: number[]; complete: boolean; [name: string]: unknown };
  /** The server's own cameras; if no camera works, the picture is frozen. */
  cameras?: { count: number; working: number };
  /** Camera hosts, if the cameras are not the server's own; `silent` contains indices from 0. */
  nodes?: { count: number; silent: number[] };
  [name: string]: unknown;
}

export interface LightfieldFailure {
  /** Message for people, as shown by the element. */
  message: string;
  /** Error of the server or the browser. */
  cause: string;
  /** HTTP status; missing if the server was not reached. */
  status?: number;
  /** Machine-readable reason: "token", "full", "filming", "path", "origin", "rate", ... */
  reason?: string;
  /** Seconds until the element tries again; Infinity: never. */
  retryAfter: number;
}

export interface LightfieldViewerEventMap {
  /** The first picture is displayed; pixels. */
  'first-frame': CustomEvent<{ width: number; height: number }>;
  /**
   * A picture of another view is displayed. `by`: author of the last movement, with the element's controls or its
   * methods.
   */
  'view-change': CustomEvent<{ view: LightfieldView; by: 'person' | 'script' }>;
  /** The focus distance of the displayed picture has changed. */
  'focus-change': CustomEvent<{ focusDistance: number }>;
  error: CustomEvent<LightfieldFailure>;
  connected: CustomEvent<null>;
  disconnected: CustomEvent<{ reason: string }>;
  statistics: CustomEvent<LightfieldStatistics>;
  /** The server has another rig, for example after a calibration; `hash` identifies the rig. The view stays. */
  rig: CustomEvent<{ hash: string }>;
}

/** `<lightfield-viewer>`: a picture of a light field with controls for its virtual camera. */
export class LightfieldViewer extends HTMLElement {
  /** The server's WHEP endpoint; null: the server of this script. */
  src: string | null;
  /** Bearer token, if the server requires one. */
  token: string | null;
  /** URL of an image shown until the first picture. */
  poster: string | null;
  /** Description of the picture for screen readers. */
  alt: string | null;
  eyes: LightfieldEyes | null;
  /** Metres between two eyes, 0 or more; null: 0.063. */
  eyeDistance: number | null;
  /** Name of a camera path that the server plays. */
  path: string | null;
  /** Enables the control bar and navigation by mouse, touch, keyboard and gamepad. */
  controls: boolean;
  /** Starts the stream when the element becomes visible. */
  autoplay: boolean;
  /** Reads the view from the page's address, and writes it there when it is shared. */
  shares: boolean;
  /** Maximum width of the requested picture in pixels per eye, at least 64. */
  maxWidth: number | null;
  /** STUN and TURN servers; null: from the attribute or from the server. */
  iceServers: RTCIceServer[] | null;
  /** The displayed view; null before the first picture. Setting the same value again changes nothing. */
  get view(): LightfieldView | null;
  set view(view: Partial<LightfieldView> | string | null);
  /** Focus distance in metres. Setting it always focuses there, even if the number is unchanged. */
  get focusDistance(): number | null;
  set focusDistance(metres: number | null);
  /** True if a picture has been displayed. */
  readonly loaded: boolean;
  readonly connected: boolean;
  readonly paused: boolean;
  /** The latest statistics; {} before the first. */
  readonly statistics: Partial<LightfieldStatistics>;
  /** The stream's connection, for inspection; null: no stream. */
  readonly connection: { readonly peer: RTCPeerConnection; readonly channel: RTCDataChannel } | null;
  /** The element with the status message; hidden if there is none. */
  readonly status: HTMLElement;

  /**
   * Missing fields keep their values. Resolves with the displayed view when this or a later view is displayed. Rejects
   * with TypeError or RangeError for an invalid number, with InvalidStateError while the server plays a path, and with
   * AbortError if `src` or `path` changes before the view is displayed.
   */
  setView(view: Partial<LightfieldView>): Promise<LightfieldView>;
  /** Flies to `view` and `focus`; the server's home view provides the remaining fields. */
  goHome(): void;
  /** Restarts the stream with the current view. */
  reconnect(): void;
  /**
   * Copies a link to the view, if the browser allows that, and returns the link. With `share`, it becomes the page's
   * address.
   */
  share(): Promise<string>;
  /**
   * Focuses at a position in the window, as in `event.clientX`, like a click. Returns false if there is no connection
   * or the server plays a path.
   */
  focusAt(clientX: number, clientY: number): boolean;
  /** Returns the displayed picture. Rejects if there is none. */
  toBlob(options?: { type?: string; quality?: number }): Promise<Blob>;
  /** Starts the stream, if there is no `autoplay`. */
  play(): void;
  /** Frees the seat on the server; the last picture stays. */
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

/** Props for JSX: properties, and listeners named like the events, such as `onview-change`. */
export type LightfieldViewerProps = Partial<Pick<LightfieldViewer, 'src' | 'token' | 'poster' | 'alt' | 'eyes' | 'eyeDistance' |
  'path' | 'controls' | 'autoplay' | 'shares' | 'maxWidth' | 'iceServers' | 'focusDistance'>> & {
  view?: Partial<LightfieldView> | string | null;
} & {
  [Name in keyof LightfieldViewerEventMap as `on${Name}`]?: (event: LightfieldViewerEventMap[Name]) => void;
};

// Types for React 19 and later; ignored if React is not installed.
declare module 'react' {
  namespace JSX {
    interface IntrinsicElements {
      // @ts-ignore
      'lightfield-viewer': LightfieldViewerProps & Omit<DetailedHTMLProps<HTMLAttributes<LightfieldViewer>, LightfieldViewer>, 'onError'>;
    }
  }
}
