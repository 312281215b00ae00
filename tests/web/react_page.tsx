// SPDX-License-Identifier: LGPL-2.1-or-later
// A light field in a typical React application. The test controls the props.
import { StrictMode, useEffect, useRef, useState } from 'react';
import { createRoot } from 'react-dom/client';
import 'lightfield-viewer';  // compilers drop type-only imports
import type { LightfieldEyes, LightfieldView, LightfieldViewer } from 'lightfield-viewer';

interface Props { src: string; yaw: number; alt?: string; eyes?: LightfieldEyes; shown: boolean; last: boolean }
declare global { var app: { render(props: Partial<Props>): void; told: string[]; renders: number; element: LightfieldViewer | null } }

function Field({ src, yaw, alt, eyes }: Props) {
  const viewer = useRef<LightfieldViewer>(null);
  const [view, setView] = useState<LightfieldView>();
  app.renders++;
  // In strict mode effects run twice.
  useEffect(() => {
    const element = viewer.current!;
    const count = ({ detail }: CustomEvent<{ reason: string }>) => app.told.push(`disconnected ${detail.reason}`);
    element.addEventListener('disconnected', count);
    app.element = element;
    return () => element.removeEventListener('disconnected', count);
  }, []);
  return <figure>
    <lightfield-viewer ref={viewer} src={src} view={{ yaw }} alt={alt} eyes={eyes} controls autoplay maxWidth={320} iceServers={null}
      className="field" style={{ width: 320, height: 240 }}
      onfirst-frame={({ detail }) => app.told.push(`first ${detail.width}x${detail.height}`)}
      onview-change={({ detail }) => { setView(detail.view); app.told.push(`${detail.by} ${detail.view.yaw}`); }}
      onerror={({ detail }) => app.told.push(`error ${detail.retryAfter}`)}>
      <p slot="error">My own words</p>
    </lightfield-viewer>
    <figcaption>{view ? `Focus: ${view.focusDistance.toFixed(2)} m` : 'Nothing yet'}</figcaption>
  </figure>;
}

function Page(props: Props) {
  const parts = [<h1 key="title">My light field</h1>, props.shown && <Field key="field" {...props} />, <p key="text">Some words</p>];
  return <>{props.last ? [parts[2], parts[0], parts[1]] : parts}</>;
}

export const wrong = () => [
  // @ts-expect-error there is no such eye
  <lightfield-viewer eyes="three" />,
  // @ts-expect-error a view has no zoom
  <lightfield-viewer view={{ zoom: 2 }} />,
  // @ts-expect-error the event has no zoom
  <lightfield-viewer onview-change={({ detail }) => detail.zoom} />,
  // @ts-expect-error React has onError only for its own elements
  <lightfield-viewer onError={() => {}} />,
  // @ts-expect-error share is a method; the property is `shares`
  <lightfield-viewer share />,
];

const root = createRoot(document.getElementById('root')!);
let props: Props = { src: `${new URLSearchParams(location.search).get('whep')}`, yaw: 1, alt: 'Mine', shown: true, last: false };
globalThis.app = { told: [], renders: 0, element: null, render(some) {
  props = { ...props, ...some };
  root.render(<StrictMode><Page {...props} /></StrictMode>);
} };
app.render({});
