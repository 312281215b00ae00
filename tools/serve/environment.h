// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf::serve {

// What many viewers take of a process: more files than usual, and less memory. Before threads are started.
void prepare_process();
// What viewers take of GStreamer: that all elements are installed, and a key for DTLS is made, which takes up to a
// second; the first viewer should not wait for it. Throws Error that names the package of what is missing.
void prepare_elements();

}  // namespace lf::serve
