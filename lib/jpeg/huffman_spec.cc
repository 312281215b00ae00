// SPDX-License-Identifier: LGPL-2.1-or-later
#include "jpeg/huffman_spec.h"

#include "base/error.h"
#include "jpeg/scan.h"

namespace lf::jpeg {
namespace {

struct Standard {
  HuffmanSpec dc[2], ac[2];
};

// Those that libjpeg's encoder begins with. Nothing in here has a destructor that a jump would pass over.
Standard make_standard() {
  Errors errors;
  jpeg_compress_struct info{};
  info.err = errors.install(false);
  if (setjmp(errors.jump)) throw Error("JPEG: libjpeg can't be used");
  jpeg_create_compress(&info);
  info.input_components = 3;
  info.in_color_space = JCS_YCbCr;
  jpeg_set_defaults(&info);
  Standard standard;
  for (int i = 0; i < 2; i++) {
    standard.dc[i] = huffman_of(*info.dc_huff_tbl_ptrs[i]);
    standard.ac[i] = huffman_of(*info.ac_huff_tbl_ptrs[i]);
  }
  jpeg_destroy_compress(&info);
  return standard;
}

const Standard& standard() {
  static const Standard tables = make_standard();
  return tables;
}

}  // namespace

const HuffmanSpec& standard_dc(int chroma) { return standard().dc[chroma]; }
const HuffmanSpec& standard_ac(int chroma) { return standard().ac[chroma]; }

}  // namespace lf::jpeg
