// Nothing is thrown through the C API: exceptions become text.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstring>
#include <new>
#include <stdexcept>
#include <system_error>

namespace glint {

/// Copies `text` into a caller's buffer of `size` bytes, cut to fit.
inline void tell(char* error, size_t size, const char* text) {
  if (!error || size == 0) return;
  size_t length = std::min(std::strlen(text), size - 1);
  std::memcpy(error, text, length);
  error[length] = 0;
}

/// What `make` gives, or `failed` with the reason in `error`.
template <class Result, class Make>
Result guarded(Result failed, char* error, size_t size, Make make) {
  try {
    return make();
  } catch (const std::bad_alloc&) {
    tell(error, size, "out of memory");
  } catch (const std::length_error&) {  // more than a vector can ever hold
    tell(error, size, "out of memory");
  } catch (const std::system_error&) {
    tell(error, size, "no thread");
  } catch (const std::exception& e) {
    tell(error, size, e.what());
  }
  return failed;
}

}  // namespace glint
