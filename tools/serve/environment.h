// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

namespace lf::serve {

// Prepares the process for many viewers, who take more files than usual, and less memory. Call before threads are
// started.
void prepare_process();
// Prepares GStreamer for viewers: all elements must be installed, and a key for DTLS is made, which takes up to a
// second; the first viewer should not wait for it. Throws Error that names the package of what is missing.
void prepare_elements();

}  // namespace lf::serve
