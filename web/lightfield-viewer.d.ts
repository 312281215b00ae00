// SPDX-License-Identifier: LGPL-2.1-or-later

/**
 * Position, orientation, field of view and focus of a virtual camera, in metres and degrees. The axis x points to the
 * right, y down and z forward.
 */
export interface LightfieldView {
  x: number;
  y: number;
  z: number;
  /** Rotation about y, then pitch about x, then roll about z. */
  yaw: number;
  pitch: number;
  roll: number;
  fov: number;
  /** Distance from the viewpoint to the plane in focus, along the optical axis. */
  focusDistance: number;
}

/** A single picture, two pictures side by side, or one picture for red-cyan glasses. */
export type LightfieldEyes = 'one' | 'side' | 'anaglyph';

/**
 * Statistics that the server sends once a second. The page docs/reference/web-interface.md of gst-lightfield describes
 * all fields.
 */
export interface LightfieldStatistics {
  pictures: number;
  incomplete: number;
  /** Fraction of the picture that the cameras cover, 0 to 1. The remaining pixels are black. */
  coverage?: number;
  /** Time from a request for a picture until the picture is composed, in milliseconds. */
  pictureMs: number;
  /** Bit rate of the video, in bits per second. */
  bitRate: number;
  frameRate: number;
  sizeDivisor: number;
  /** Fraction of packets that are lost on the network, 0 to 1. */
  loss: number;
  roundTripMs: number;
  /**
   * The view of the latest picture: position in metres, orientation as w, x, y, z, and more
   * (docs/reference/web-interface.md).
   */
  picture?: { sequence: number; position: number[]; orientation: number[]; complete: boolean; [name: string]: unknown };
  /** State of the cameras that the server itself runs. If no camera works, the picture is frozen. */
  cameras?: { count: number; working: number };
  /**
   * State of the hosts that run the cameras, if the server does not run them itself. `silent` contains the indices of
   * hosts that do not answer; the first host has index 0.
   */
  nodes?: { count: number; silent: number[] };
  [name: string]: unknown;
}

export interface LightfieldFailure {
  message: string;
  cause: string;
  /** HTTP status; missing if the server could not be reached. */
  status?: number;
  /** Reason for programs, such as "token", "full", "filming", "path", "origin" or "rate". */
  reason?: string;
  /** Seconds until the element tries again; Infinity if it gives up. */
  retryAfter: number;
}

export interface LightfieldViewerEventMap {
  /** The first picture of a stream is displayed, with this size in pixels. */
  'first-frame': CustomEvent<{ width: number; height: number }>;
  /**
   * The displayed picture shows another view. `by` tells if a person moved the view with the element's controls, or a
   * script with its methods.
   */
  'view-change': CustomEvent<{ view: LightfieldView; by: 'person' | 'script' }>;
  'focus-change': CustomEvent<{ focusDistance: number }>;
  error: CustomEvent<LightfieldFailure>;
  connected: CustomEvent<null>;
  /**
   * All seats are taken, and the element shows the camera path `path` of the server until it gets a seat. With null, it
   * no longer shows the path.
   */
  fallback: CustomEvent<{ path: string | null }>;
  disconnected: CustomEvent<{ reason: string }>;
  statistics: CustomEvent<LightfieldStatistics>;
  /**
   * The server has loaded another rig, for example after a calibration. `hash` identifies the rig. The view stays
   * unchanged.
   */
  rig: CustomEvent<{ hash: string }>;
}

/** The element `<lightfield-viewer>` shows pictures of a light field and lets people move its virtual camera. */
export class LightfieldViewer extends HTMLElement {
  /**
   * URL of the server's WHEP endpoint. With null, the element uses the server that delivered this script. A WHEP server
   * other than lf-serve is shown as a plain video.
   */
  src: string | null;
  token: string | null;
  /** URL of an image that is shown until the first picture. */
  poster: string | null;
  alt: string | null;
  eyes: LightfieldEyes | null;
  /** Distance between the two eyes in metres, at least 0. With null, 0.063. */
  eyeDistance: number | null;
  /** Name of a camera path that the server plays, instead of a view that the user controls. */
  path: string | null;
  /** Shows the control bar, and enables navigation by mouse, touch, keyboard and gamepad. */
  controls: boolean;
  /** Starts the stream when the element becomes visible. */
  autoplay: boolean;
  /**
   * Connects the view with the address of the page: the first view is read from there, and written there when the user
   * shares it.
   */
  shares: boolean;
  /** Maximum width of the requested picture, in pixels per eye, at least 64. Smaller pictures need less bandwidth. */
  maxWidth: number | null;
  /** STUN and TURN servers. With null, they come from the attribute or from the server. */
  iceServers: RTCIceServer[] | null;
  /** The displayed view, or null before the first picture. Setting the same value again changes nothing. */
  get view(): LightfieldView | null;
  set view(view: Partial<LightfieldView> | string | null);
  /** Focus distance in metres. Setting a number always focuses there, even if the number is unchanged. */
  get focusDistance(): number | null;
  set focusDistance(metres: number | null);
  readonly loaded: boolean;
  /** The stream of the element's own view is open. False during a fallback. */
  readonly connected: boolean;
  /** Name of the camera path that is shown while all seats of the server are taken, or null. */
  readonly fallback: string | null;
  /**
   * The controls and setView() can move the picture. False for a path, during a fallback, and for a plain WHEP server,
   * which only sends video.
   */
  readonly interactive: boolean;
  readonly paused: boolean;
  readonly statistics: Partial<LightfieldStatistics>;
  /** The connection of the stream, for inspection; null if there is no stream. Plain WHEP servers have no channel. */
  readonly connection: { readonly peer: RTCPeerConnection; readonly channel?: RTCDataChannel } | null;
  /** The element with the status message, which is hidden if there is none. */
  readonly status: HTMLElement;

  /**
   * Moves the virtual camera. Missing fields keep their values. The promise resolves with the displayed view when this
   * view, or a later one, is displayed. It rejects with TypeError or RangeError if a number is invalid, with
   * InvalidStateError while the server plays a path or only sends video, and with AbortError if `src` or `path` changes
   * before. During a fallback, it waits for a seat.
   */
  setView(view: Partial<LightfieldView>): Promise<LightfieldView>;
  /** Flies back to the start view: `view` and `focus`, with all missing fields from the server's home view. */
  goHome(): void;
  reconnect(): void;
  /**
   * Returns a link to the displayed view, and copies it to the clipboard if the browser allows that. With `share`, the
   * link also becomes the address of the page.
   */
  share(): Promise<string>;
  /**
   * Focuses on the object at a position in the window (as in `event.clientX`), like a click. Returns false if there is
   * no connection, or the picture is not `interactive`.
   */
  focusAt(clientX: number, clientY: number): boolean;
  /** Returns the displayed picture. The promise rejects if there is none. */
  toBlob(options?: { type?: string; quality?: number }): Promise<Blob>;
  /** Starts the stream. This is only needed without `autoplay`. */
  play(): void;
  /**
   * Ends the stream, which frees the seat on the server. The last picture stays visible, and people can look around in it
   * with the controls. play() continues with their view.
   */
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

/** Props for JSX: the properties, and listeners named like the events, such as `onview-change`. */
export type LightfieldViewerProps = Partial<Pick<LightfieldViewer, 'src' | 'token' | 'poster' | 'alt' | 'eyes' | 'eyeDistance' |
  'path' | 'controls' | 'autoplay' | 'shares' | 'maxWidth' | 'iceServers' | 'focusDistance'>> & {
  view?: Partial<LightfieldView> | string | null;
} & {
  [Name in keyof LightfieldViewerEventMap as `on${Name}`]?: (event: LightfieldViewerEventMap[Name]) => void;
};

// Types for React 19 and later, which have no effect if React is not installed.
declare module 'react' {
  namespace JSX {
    interface IntrinsicElements {
      // @ts-ignore
      'lightfield-viewer': LightfieldViewerProps & Omit<DetailedHTMLProps<HTMLAttributes<LightfieldViewer>, LightfieldViewer>, 'onError'>;
    }
  }
}
