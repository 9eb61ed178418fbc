#include "service_route.hpp"

#include <cstring>

namespace plane {
namespace {

std::string with_length(const std::string & text) {
  const auto length = static_cast<uint32_t>(text.size());
  return std::string(reinterpret_cast<const char *>(&length), sizeof length) + text;
}

}  // namespace

Frame text_frame(const std::string & text) {
  const std::string bytes = with_length(text);
  auto frame = std::make_shared<Buffer>();
  frame->reserve(bytes.size());
  std::memcpy(frame->data(), bytes.data(), bytes.size());
  frame->set_size(bytes.size());
  return frame;
}

Frame refusal_frame(const Refusal & refusal, const std::string & reason) {
  return text_frame(refusal.has_text ? refusal.before + with_length(reason) + refusal.after : refusal.before);
}

}  // namespace plane
