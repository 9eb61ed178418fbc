#include "service_route.hpp"

#include <cstring>

namespace plane {
namespace {

std::string with_length(const std::string & text) {
  const auto length = static_cast<uint32_t>(text.size());
  return std::string(reinterpret_cast<const char *>(&length), sizeof length) + text;
}

}  // namespace

Frame refusal_frame(const Refusal & refusal, const std::string & reason) {
  const std::string bytes = refusal.has_text ? refusal.before + with_length(reason) + refusal.after : refusal.before;
  return framed(bytes.data(), bytes.size());
}

}  // namespace plane
