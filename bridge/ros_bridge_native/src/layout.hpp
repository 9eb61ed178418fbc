// Messages as bytes: ROS 1's serialization to CDR and back, by a small program compiled from the type's definition (layout.py).
//
// Both serializations have the same fields in the same order. They differ in this: CDR aligns each number to its size, counted from the end
// of the encapsulation; a CDR string's length counts a closing NUL; Header.seq exists in ROS 1 only; an empty message has one byte in CDR.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace plane {

enum class Code : uint32_t {
  kFixed = 0,     // a: alignment, b: bytes. Numbers one behind the other without padding in CDR.
  kSequence = 1,  // a: alignment, b: bytes of an element. A length and that many elements of such numbers.
  kString = 2,
  kSequenceNumber = 3,  // four bytes that only ROS 1 has
  kPadding = 4,         // a byte that only CDR has
  kRepeat = 5,          // a: number of times, b: operations of the body, which follow
  kRepeatCounted = 6,   // b: operations of the body, c: the least bytes of one element in ROS 1; a length and that many bodies
};

struct Operation {
  Code code;
  uint32_t a;
  uint32_t b;
  uint32_t c;
};

using Program = std::vector<Operation>;

// No message may be larger, on either side.
constexpr size_t kMostBytes = size_t{1} << 30;
// What comes from the network as a number of elements that take no bytes.
constexpr uint32_t kMostEmptyElements = 1u << 20;

// Return whether the operations are well formed: bodies inside the program, alignments 1, 2, 4, 8.
bool valid(const Program & program);

// Return the bytes that the message takes in CDR (without encapsulation), or SIZE_MAX if the bytes are no message of this layout.
size_t cdr_size(const Program & program, const uint8_t * ros1, size_t size);
// Write a message that cdr_size has measured.
void write_cdr(const Program & program, const uint8_t * ros1, size_t size, uint8_t * cdr);

// The same in the other direction; CDR may be followed by padding. `sequence` goes into the first Header.seq, others become 0.
size_t ros1_size(const Program & program, const uint8_t * cdr, size_t size);
void write_ros1(const Program & program, const uint8_t * cdr, size_t size, uint32_t sequence, uint8_t * ros1);

}  // namespace plane
