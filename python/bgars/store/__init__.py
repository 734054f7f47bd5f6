"""The store: results of many parts as a Parquet data set that answers questions."""

from bgars.store.data_set import Store, is_store, open_store
from bgars.store.keys import part_key

__all__ = ["Store", "is_store", "open_store", "part_key"]
