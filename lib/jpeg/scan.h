// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <algorithm>
#include <csetjmp>
#include <cstddef>
#include <cstdio>

#include <jpeglib.h>

#include "jpeg/huffman_spec.h"

// What all uses of libjpeg have in common here.
namespace lf::jpeg {

// A baseline JPEG of ours is this header, a scan and EOI: no JFIF marker, no tables. Only the scan travels.
inline constexpr size_t kPixelHeader = 35, kLostHeader = 25;  // bytes of SOI, SOF0, SOS for three components, for one
inline constexpr size_t kEoi = 2;

inline HuffmanSpec huffman_of(const JHUFF_TBL& table) {
  HuffmanSpec spec;
  std::copy_n(table.bits + 1, spec.counts.size(), spec.counts.begin());
  std::copy_n(table.huffval, spec.symbols.size(), spec.symbols.begin());
  return spec;
}

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
