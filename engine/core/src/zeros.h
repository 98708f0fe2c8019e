// Arrays that cost nothing until they are written.
#pragma once
#include <cstdlib>
#include <memory>
#include <new>

namespace glint {

/// Numbers that are 0 until written; pages that nobody touches cost nothing.
template <class T>
class Zeros {
 public:
  Zeros() = default;
  /// Throws std::bad_alloc.
  explicit Zeros(size_t size) : size_(size), values_(static_cast<T*>(std::calloc(size, sizeof(T)))) {
    if (!values_) throw std::bad_alloc();
  }
  T* data() const { return values_.get(); }
  size_t size() const { return size_; }

 private:
  struct Free {
    void operator()(T* p) const { std::free(p); }
  };
  size_t size_ = 0;
  std::unique_ptr<T, Free> values_;
};

}  // namespace glint
