#include "layout.hpp"

#include <cstring>

namespace plane {
namespace {

constexpr size_t kBad = SIZE_MAX;

// Bytes that come in, with a guard at their end.
struct Input {
  const uint8_t * begin;
  size_t size;
  size_t position = 0;

  size_t rest() const { return size - position; }

  bool align(size_t to) {
    const size_t aligned = (position + to - 1) & ~(to - 1);
    if (aligned > size) return false;
    position = aligned;
    return true;
  }

  bool number(uint32_t & value) {
    if (rest() < sizeof value) return false;
    std::memcpy(&value, begin + position, sizeof value);
    position += sizeof value;
    return true;
  }

  const uint8_t * take(size_t bytes) {
    if (rest() < bytes) return nullptr;
    const uint8_t * here = begin + position;
    position += bytes;
    return here;
  }
};

// Where bytes go when only their number is wanted.
struct Measure {
  size_t position = 0;

  void align(size_t to) { position = (position + to - 1) & ~(to - 1); }
  void number(uint32_t) { position += 4; }
  void copy(const uint8_t *, size_t bytes) { position += bytes; }
  void zero(size_t bytes) { position += bytes; }
  bool full() const { return position > kMostBytes; }
};

// Where bytes go that were measured before.
struct Write {
  uint8_t * begin;
  size_t position = 0;

  void align(size_t to) {
    while (position & (to - 1)) begin[position++] = 0;
  }
  void number(uint32_t value) {
    std::memcpy(begin + position, &value, sizeof value);
    position += sizeof value;
  }
  void copy(const uint8_t * from, size_t bytes) {
    if (bytes) std::memcpy(begin + position, from, bytes);
    position += bytes;
  }
  void zero(size_t bytes) {
    std::memset(begin + position, 0, bytes);
    position += bytes;
  }
  bool full() const { return false; }
};

// ROS 1 in, CDR out. Each function returns false when the bytes are no message of the layout.
template <class Output>
struct ToCdr {
  Input in;
  Output out;

  bool run(const Operation * operation, const Operation * end) {
    for (; operation != end; ++operation) {
      if (out.full() || !step(*operation, operation + 1)) return false;
      if (operation->code == Code::kRepeat || operation->code == Code::kRepeatCounted) operation += operation->b;
    }
    return true;
  }

  bool step(const Operation & operation, const Operation * body) {
    switch (operation.code) {
      case Code::kFixed: out.align(operation.a); return move(operation.b);
      case Code::kSequence: return sequence(operation.a, operation.b);
      case Code::kString: return string();
      case Code::kSequenceNumber: return in.take(4) != nullptr;
      case Code::kPadding: out.zero(1); return true;
      case Code::kRepeat: return repeat(operation.a, body, operation.b);
      case Code::kRepeatCounted: return counted(operation, body);
    }
    return false;
  }

  bool move(size_t bytes) {
    const uint8_t * from = in.take(bytes);
    if (from == nullptr) return false;
    out.copy(from, bytes);
    return true;
  }

  bool sequence(size_t alignment, size_t element_bytes) {
    uint32_t count;
    if (!in.number(count) || count > in.rest() / element_bytes) return false;
    out.align(4);
    out.number(count);
    if (count) out.align(alignment);
    return move(count * element_bytes);
  }

  bool string() {
    uint32_t length;
    if (!in.number(length) || length > in.rest()) return false;
    out.align(4);
    out.number(length + 1);
    if (!move(length)) return false;
    out.zero(1);
    return true;
  }

  bool repeat(uint32_t times, const Operation * body, size_t operations) {
    for (uint32_t i = 0; i < times; ++i) {
      if (!run(body, body + operations)) return false;
    }
    return true;
  }

  bool counted(const Operation & operation, const Operation * body) {
    uint32_t count;
    if (!in.number(count)) return false;
    if (operation.c ? count > in.rest() / operation.c : count > kMostEmptyElements) return false;
    out.align(4);
    out.number(count);
    return repeat(count, body, operation.b);
  }
};

// CDR in, ROS 1 out.
template <class Output>
struct ToRos1 {
  Input in;
  Output out;
  uint32_t sequence_number;

  bool run(const Operation * operation, const Operation * end) {
    for (; operation != end; ++operation) {
      if (out.full() || !step(*operation, operation + 1)) return false;
      if (operation->code == Code::kRepeat || operation->code == Code::kRepeatCounted) operation += operation->b;
    }
    return true;
  }

  bool step(const Operation & operation, const Operation * body) {
    switch (operation.code) {
      case Code::kFixed: return in.align(operation.a) && move(operation.b);
      case Code::kSequence: return sequence(operation.a, operation.b);
      case Code::kString: return string();
      case Code::kSequenceNumber:
        out.number(out.position == 0 ? sequence_number : 0);
        return true;
      case Code::kPadding: return in.take(1) != nullptr;
      case Code::kRepeat: return repeat(operation.a, body, operation.b);
      case Code::kRepeatCounted: return counted(body, operation.b);
    }
    return false;
  }

  bool move(size_t bytes) {
    const uint8_t * from = in.take(bytes);
    if (from == nullptr) return false;
    out.copy(from, bytes);
    return true;
  }

  bool count(uint32_t & value) { return in.align(4) && in.number(value); }

  bool sequence(size_t alignment, size_t element_bytes) {
    uint32_t number;
    if (!count(number) || number > in.rest() / element_bytes) return false;
    out.number(number);
    return (number == 0 || in.align(alignment)) && move(number * element_bytes);
  }

  bool string() {
    uint32_t length;
    if (!count(length)) return false;
    const uint8_t * text = in.take(length);
    if (text == nullptr) return false;
    if (length && text[length - 1] == 0) --length;
    out.number(length);
    out.copy(text, length);
    return true;
  }

  bool repeat(uint32_t times, const Operation * body, size_t operations) {
    for (uint32_t i = 0; i < times; ++i) {
      if (!run(body, body + operations)) return false;
    }
    return true;
  }

  bool counted(const Operation * body, size_t operations) {
    uint32_t number;
    if (!count(number) || number > in.rest()) return false;  // every element has a byte at least
    out.number(number);
    return repeat(number, body, operations);
  }
};

bool valid_range(const Operation * operation, const Operation * end, int depth) {
  for (; operation != end; ++operation) {
    const bool numbers = operation->code == Code::kFixed || operation->code == Code::kSequence;
    if (operation->code > Code::kRepeatCounted || depth > 64) return false;
    if (numbers && (operation->a == 0 || operation->a > 8 || (operation->a & (operation->a - 1)) || operation->b == 0)) return false;
    if (operation->code == Code::kRepeat || operation->code == Code::kRepeatCounted) {
      if (operation->b == 0 || operation->b > static_cast<size_t>(end - operation - 1)) return false;
      if (!valid_range(operation + 1, operation + 1 + operation->b, depth + 1)) return false;
      operation += operation->b;
    }
  }
  return true;
}

}  // namespace

bool valid(const Program & program) { return valid_range(program.data(), program.data() + program.size(), 0); }

size_t cdr_size(const Program & program, const uint8_t * ros1, size_t size) {
  ToCdr<Measure> walk{{ros1, size}, {}};
  const bool good = walk.run(program.data(), program.data() + program.size()) && !walk.out.full() && walk.in.rest() == 0;
  return good ? walk.out.position : kBad;
}

void write_cdr(const Program & program, const uint8_t * ros1, size_t size, uint8_t * cdr) {
  ToCdr<Write> walk{{ros1, size}, {cdr}};
  walk.run(program.data(), program.data() + program.size());
}

size_t ros1_size(const Program & program, const uint8_t * cdr, size_t size) {
  ToRos1<Measure> walk{{cdr, size}, {}, 0};
  return walk.run(program.data(), program.data() + program.size()) && !walk.out.full() ? walk.out.position : kBad;
}

void write_ros1(const Program & program, const uint8_t * cdr, size_t size, uint32_t sequence, uint8_t * ros1) {
  ToRos1<Write> walk{{cdr, size}, {ros1}, sequence};
  walk.run(program.data(), program.data() + program.size());
}

}  // namespace plane
