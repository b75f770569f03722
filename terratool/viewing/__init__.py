"""What people look at: pictures, a page to turn a terrain about, and what an edit changed."""
