// SPDX-License-Identifier: LGPL-2.1-or-later
// Writes the initial inputs: fuzz-seeds FOLDER creates FOLDER/TARGET/....
#include <filesystem>
#include <fstream>

#include "fuzz/seeds.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  for (const auto& [target, inputs] : lf::fuzz::seeds()) {
    const std::filesystem::path folder = std::filesystem::path(argv[1]) / target;
    std::filesystem::create_directories(folder);
    for (size_t i = 0; i < inputs.size(); i++)
      std::ofstream(folder / ("seed-" + std::to_string(i)), std::ios::binary)
          .write(reinterpret_cast<const char*>(inputs[i].data()), static_cast<std::streamsize>(inputs[i].size()));
  }
}
