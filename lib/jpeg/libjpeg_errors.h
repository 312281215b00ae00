// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <csetjmp>
#include <cstddef>
#include <cstdio>

#include <jpeglib.h>

namespace lf::jpeg {

// Replaces libjpeg's error handling, which would end the process.
struct Errors {
  jpeg_error_mgr manager;  // must be first, because libjpeg returns a pointer to this member
  std::jmp_buf jump;

  // Errors jump to `jump`, and so do warnings if `warnings_too`. Nothing is printed.
  jpeg_error_mgr* install(bool warnings_too) {
    jpeg_std_error(&manager);
    manager.error_exit = fail;
    manager.emit_message = warnings_too ? fail_on_warning : [](j_common_ptr, int) {};
    return &manager;
  }

 private:
  [[noreturn]] static void fail(j_common_ptr info) { std::longjmp(reinterpret_cast<Errors*>(info->err)->jump, 1); }
  static void fail_on_warning(j_common_ptr info, int level) {
    if (level < 0) fail(info);  // other levels are traces
  }
};

}  // namespace lf::jpeg
