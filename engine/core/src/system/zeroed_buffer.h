// Arrays that cost nothing until they are written.
#pragma once
#include <cstdint>
#include <memory>
#include <new>

#include "system/page_allocator.h"

namespace glint {

/// Numbers that are 0 until written; pages that nobody touches cost nothing.
template <class T>
class ZeroedBuffer {
 public:
  ZeroedBuffer() = default;
  /// Throws std::bad_alloc.
  explicit ZeroedBuffer(size_t size) : size_(size), values_(take(size), Give{size * sizeof(T)}) {}
  T* data() const { return values_.get(); }
  size_t size() const { return size_; }

 private:
  struct Give {
    size_t bytes = 0;
    void operator()(T* p) const { free_zeroed(p, bytes); }
  };
  static T* take(size_t size) {
    if (size > PTRDIFF_MAX / sizeof(T)) throw std::bad_alloc();
    return static_cast<T*>(allocate_zeroed(size * sizeof(T)));
  }
  size_t size_ = 0;
  std::unique_ptr<T, Give> values_;
};

}  // namespace glint
