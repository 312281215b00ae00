// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <csetjmp>
#include <cstddef>
#include <cstdio>

#include <jpeglib.h>

namespace lf::jpeg {

// libjpeg's default is to end the process.
struct Errors {
  jpeg_error_mgr manager;  // first: libjpeg hands back a pointer to it
  std::jmp_buf jump;

  // Errors go to `jump`; warnings too, if they are errors for the caller. Nothing is printed.
  jpeg_error_mgr* install(bool warnings_too) {
    jpeg_std_error(&manager);
    manager.error_exit = fail;
    manager.emit_message = warnings_too ? fail_on_warning : [](j_common_ptr, int) {};
    return &manager;
  }

 private:
  [[noreturn]] static void fail(j_common_ptr info) { std::longjmp(reinterpret_cast<Errors*>(info->err)->jump, 1); }
  static void fail_on_warning(j_common_ptr info, int level) {
    if (level < 0) fail(info);  // others are traces
  }
};

}  // namespace lf::jpeg
