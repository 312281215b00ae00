// SPDX-License-Identifier: LGPL-2.1-or-later
#include "render/gl/computed.h"

#include <cstring>

namespace lf::gl {

constexpr size_t kWord = sizeof(uint32_t);

bool wait_for_card() {
  const GLsync done = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
  constexpr GLuint64 kLongest = 10'000'000'000;  // ns; a card that takes longer is lost
  const GLenum state = glClientWaitSync(done, GL_SYNC_FLUSH_COMMANDS_BIT, kLongest);
  glDeleteSync(done);
  return state == GL_ALREADY_SIGNALED || state == GL_CONDITION_SATISFIED;
}

size_t Computed::most_words() {
  GLint64 most = 0;  // bytes
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most);
  return static_cast<size_t>(most) / kWord;
}

bool Computed::reserve(size_t words, std::string& why) {
  if (words > most_words()) {
    why = "the view is too large";
    return false;
  }
  words_ = words;
  result_.reserve(kWord * words);
  return true;
}

std::shared_ptr<Computed::Fetched> Computed::begin_to_fetch() {
  Fetched* free = nullptr;
  for (const auto& fetched : fetched_)
    if (!free && fetched->is_free_.exchange(false)) free = fetched.get();
  if (!free) {
    free = fetched_.emplace_back(std::make_unique<Fetched>()).get();
    free->is_free_ = false;
  }
  free->buffer_.reserve(kWord * words_);
  if (!free->buffer_.memory()) free->memory_.resize(kWord * words_);
  return {free, [](Fetched* fetched) { fetched->is_free_ = true; }};
}

bool Computed::fetch(Fetched& to, std::span<const Words> which) {
  glBindBuffer(GL_COPY_READ_BUFFER, result_.name());
  glBindBuffer(GL_COPY_WRITE_BUFFER, to.buffer_.name());
  const auto at = [](size_t word) { return static_cast<GLintptr>(kWord * word); };
  for (const auto& [first, end] : which)
    glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, at(first), at(first), at(end - first));
  if (to.buffer_.memory()) return wait_for_card();
  for (const auto& [first, end] : which) {
    const void* mapped = glMapBufferRange(GL_COPY_WRITE_BUFFER, at(first), at(end - first), GL_MAP_READ_BIT);
    if (!mapped) return false;
    std::memcpy(to.memory_.data() + at(first), mapped, kWord * (end - first));
    glUnmapBuffer(GL_COPY_WRITE_BUFFER);
  }
  return true;
}

}  // namespace lf::gl
