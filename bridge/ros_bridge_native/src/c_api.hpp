// What the files of the C interface share.
#pragma once

#include <cstdint>
#include <exception>
#include <string>

#include "layout.hpp"

#define PLANE_API extern "C" __attribute__((visibility("default")))

namespace plane {

// Why the last function failed that this thread has called.
inline thread_local std::string last_error;

// Return what the function returns, or `otherwise` when it throws.
template <class Result, class Function>
Result guarded(Result otherwise, Function function) {
  try {
    return function();
  } catch (const std::exception & error) {
    last_error = error.what();
  } catch (...) {
    last_error = "unknown exception";
  }
  return otherwise;
}

// Throws std::runtime_error.
Program program_of(const uint32_t * words, size_t operations);

}  // namespace plane
