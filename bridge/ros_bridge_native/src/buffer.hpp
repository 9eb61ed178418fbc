// Memory for messages. Fresh pages of an image cost more than its copy, so buffers are used again.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <new>
#include <vector>

namespace plane {

// Bytes whose memory is not cleared when it grows.
class Buffer {
 public:
  Buffer() = default;
  Buffer(Buffer && other) noexcept { swap(other); }
  Buffer & operator=(Buffer && other) noexcept {
    swap(other);
    return *this;
  }
  Buffer(const Buffer &) = delete;
  Buffer & operator=(const Buffer &) = delete;
  ~Buffer() { std::free(data_); }

  uint8_t * data() { return data_; }
  const uint8_t * data() const { return data_; }
  size_t size() const { return size_; }
  size_t capacity() const { return capacity_; }
  void set_size(size_t size) { size_ = size; }

  // Make room; what is there (up to size) is kept.
  void reserve(size_t capacity) {
    if (capacity <= capacity_) return;
    auto * grown = static_cast<uint8_t *>(std::malloc(capacity));
    if (grown == nullptr) throw std::bad_alloc();
    if (size_) std::memcpy(grown, data_, size_);
    std::free(data_);
    data_ = grown;
    capacity_ = capacity;
  }

  void swap(Buffer & other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

 private:
  uint8_t * data_ = nullptr;
  size_t size_ = 0;
  size_t capacity_ = 0;
};

using Frame = std::shared_ptr<Buffer>;

// Return a frame: four bytes of length, then the bytes.
inline Frame framed(const void * bytes, size_t size) {
  const auto length = static_cast<uint32_t>(size);
  auto frame = std::make_shared<Buffer>();
  frame->reserve(sizeof length + size);
  std::memcpy(frame->data(), &length, sizeof length);
  if (size) std::memcpy(frame->data() + sizeof length, bytes, size);
  frame->set_size(sizeof length + size);
  return frame;
}

// Frames of one route; the last ones to be let go are kept for the next messages.
class Pool : public std::enable_shared_from_this<Pool> {
 public:
  Frame get() {
    Buffer * buffer = nullptr;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      if (!free_.empty()) {
        buffer = free_.back().release();
        free_.pop_back();
      }
    }
    if (buffer == nullptr) buffer = new Buffer();
    buffer->set_size(0);
    return Frame(buffer, [pool = shared_from_this()](Buffer * used) { pool->put(used); });
  }

 private:
  static constexpr size_t kKept = 3;

  void put(Buffer * used) {
    std::unique_ptr<Buffer> buffer(used);
    std::lock_guard<std::mutex> lock(mutex_);
    if (free_.size() < kKept) free_.push_back(std::move(buffer));
  }

  std::mutex mutex_;
  std::vector<std::unique_ptr<Buffer>> free_;
};

}  // namespace plane
