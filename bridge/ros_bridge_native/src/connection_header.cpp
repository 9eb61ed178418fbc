#include "connection_header.hpp"

#include <cstring>

namespace plane {
namespace {

void append_number(std::string & text, uint32_t number) { text.append(reinterpret_cast<const char *>(&number), sizeof number); }

std::string value(const Fields & fields, const char * name) {
  const auto found = fields.find(name);
  return found == fields.end() ? std::string() : found->second;
}

bool fits(const std::string & theirs, const std::string & ours) { return theirs == ours || theirs == "*" || ours == "*"; }

}  // namespace

std::string encode(const Fields & fields) {
  std::string body;
  for (const auto & [name, text] : fields) {
    append_number(body, static_cast<uint32_t>(name.size() + 1 + text.size()));
    body += name + '=' + text;
  }
  std::string header;
  append_number(header, static_cast<uint32_t>(body.size()));
  return header + body;
}

bool decode(const uint8_t * data, size_t size, Fields & fields) {
  const uint8_t * end = data + size;
  while (data != end) {
    uint32_t length;
    if (static_cast<size_t>(end - data) < sizeof length) return false;
    std::memcpy(&length, data, sizeof length);
    data += sizeof length;
    if (static_cast<size_t>(end - data) < length) return false;
    const std::string field(reinterpret_cast<const char *>(data), length);
    const size_t divider = field.find('=');
    if (divider == std::string::npos) return false;
    fields[field.substr(0, divider)] = field.substr(divider + 1);
    data += length;
  }
  return true;
}

std::string mismatch(const Fields & peer, const TopicIdentity & own) {
  const std::string type = value(peer, "type"), sum = value(peer, "md5sum");
  if (sum.empty()) return "the connection header has no md5sum";
  if (!type.empty() && !fits(type, own.type)) return "type is " + type + ", here it is " + own.type;
  if (!fits(sum, own.md5sum)) return "md5sum of " + own.type + " is " + sum + ", here it is " + own.md5sum;
  return "";
}

std::string mismatch(const Fields & peer, const ServiceIdentity & own) {
  const std::string sum = value(peer, "md5sum");
  if (sum.empty()) return "the connection header has no md5sum";
  if (!fits(sum, own.md5sum)) return "md5sum of " + own.type + " is " + sum + ", here it is " + own.md5sum;
  return "";
}

}  // namespace plane
